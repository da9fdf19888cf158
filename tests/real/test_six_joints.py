"""Six joints of a real robot: published parameters and a fit give the errors that its data's README states."""

import numpy as np
import pytest
from scipy import signal

from pellucid import _core

REST = 0.1  # rad/s
RATE = 5000.0
# What Staubli TX40's configuration states of it.
VISCOUS = np.array([8.05, 5.53, 1.97, 1.11, 1.86, 0.65])
COULOMB = np.array([7.14, 8.26, 6.34, 2.48, 3.03, 0.282])
ROTOR = np.array([0.362, 0.362, 0.0988, 0.0313, 0.0468, 0.0105])
OFFSET = np.array([0.392, 1.37, 0.326, -0.102, -0.0288, 0.127])
SHARED = np.array([0.00964, 0.616, 1.95])  # inertia, viscous and dry friction of the motor that joints 5 and 6 share


@pytest.fixture(scope="module")
def recorded(data_folder):
    """Tree of the maker's numbers, position, velocity, acceleration, effort, own and shared columns, moving rows."""
    pin = pytest.importorskip("pinocchio")
    folder = data_folder / "staubli_tx40"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not here")
    model = pin.buildModelFromUrdf(str(folder / "tx40_mdh_modified.urdf"))
    rows = np.zeros((6, len(_core.LINK_PARAMETER_NAMES)))
    for i, row in enumerate(rows):
        placed = model.jointPlacements[i + 1]
        row[:8] = [i, 1, *placed.translation, *pin.rpy.matrixToRpy(placed.rotation)]
        assert model.joints[i + 1].shortname() == "JointModelRZ"
        row[10] = 1.0
        row[12:] = model.inertias[i + 1].toDynamicParameters()[[0, 1, 2, 3, 4, 5, 7, 6, 8, 9]]
    turns = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
    turns[5, 4] = 32.0
    read = {
        name: np.loadtxt(folder / name, delimiter=",", skiprows=1) for name in ("pos_read_data.csv", "curr_data.csv")
    }
    q = np.linalg.solve(turns, read["pos_read_data.csv"].T).T + np.array([0, -1, 1, 0, 0, 0]) * np.pi / 2
    b, a = signal.butter(4, 50.0 / (RATE / 2))
    q, effort = (signal.filtfilt(b, a, x, axis=0) for x in (q, read["curr_data.csv"] @ turns))
    v = np.gradient(q, 1 / RATE, axis=0)
    acceleration = np.gradient(v, 1 / RATE, axis=0)
    kept = np.arange(200, len(q) - 200, 10)
    kept = kept[kept / RATE < 7.62]
    q, v, acceleration, effort = (x[kept] for x in (q, v, acceleration, effort))
    wrist = v[:, 4] + v[:, 5]
    moving = np.abs(v) > REST
    moving[:, 4:] &= (np.abs(wrist) > REST)[:, None]
    own = np.stack([acceleration, v, np.tanh(v / 0.02), np.ones_like(v)], axis=-1)
    shared = np.zeros((len(q), 6, 3))
    for here, other in ((4, 5), (5, 4)):
        shared[:, here] = np.stack([acceleration[:, other], v[:, other], np.tanh(wrist / 0.02)], axis=-1)
    return _core.KinematicTree(rows, [0.0, 0.0, -9.81]), (q, v, acceleration), effort, own, shared, moving


def errors(residual, effort, moving):
    """Of each joint, in per cent of its effort."""
    rms = [[np.sqrt(np.mean(x[moving[:, k], k] ** 2)) for k in range(6)] for x in (residual, effort)]
    return 100.0 * np.divide(*rms)


def test_published_parameters_err_as_stated(recorded):
    tree, motion, effort, own, shared, moving = recorded
    made = tree.inverse_dynamics(*motion) + shared @ SHARED
    made += np.einsum("njk,jk->nj", own, np.stack([ROTOR, VISCOUS, COULOMB, OFFSET], axis=-1))
    np.testing.assert_allclose(errors(effort - made, effort, moving), [12.8, 8.5, 9.6, 8.5, 11.1, 9.6], atol=0.06)


def test_a_fit_from_normal_equations_alone_errs_as_stated(recorded):
    tree, motion, effort, own, shared, moving = recorded
    y = tree.regressor(*motion, own=own, shared=shared)
    weight = moving.astype(float)
    for _ in range(5):
        normal, projected, _ = tree.normal_equations(*motion, effort, weight=weight, own=own, shared=shared)
        size = np.sqrt(np.maximum(np.diag(normal), 1e-30))
        values, vectors = np.linalg.eigh(normal / np.outer(size, size))
        seen = values > 1e-10 * values[-1]
        theta = vectors[:, seen] @ ((vectors[:, seen].T @ (projected / size)) / values[seen]) / size
        residual = effort - y @ theta
        weight = moving / np.array([np.mean(residual[moving[:, k], k] ** 2) for k in range(6)])
    np.testing.assert_allclose(errors(residual, effort, moving), [5.2, 5.4, 7.5, 7.8, 11.1, 9.5], atol=0.06)
