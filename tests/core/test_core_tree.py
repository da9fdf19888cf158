"""Trees of bodies against Pinocchio, plain differences and conservation."""

import os
import subprocess
import sys

import numpy as np
import pytest
from trees import FIXED, GRAVITY, INDEX, PINOCCHIO_ORDER, PRISMATIC, REVOLUTE, in_pinocchio, random_tree, tree_of

from pellucid import _core

POINTS = {"zero": 0.0, "tiny": 1e-8, "random": 1.0}


def motions(rng, scale, n, m):
    return scale * rng.uniform(-3, 3, (n, m)), scale * rng.uniform(-5, 5, (n, m)), scale * rng.uniform(-30, 30, (n, m))


def close(found, expected, tolerance=1e-12):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * max(1.0, np.abs(expected).max()))


@pytest.fixture(scope="module")
def pin():
    return pytest.importorskip("pinocchio")


@pytest.mark.parametrize("scale", POINTS.values(), ids=POINTS)
def test_dynamics_are_pinocchios(rng, pin, scale):
    for links in (1, 2, 3, 4, 5, 6, 7, 8, 12):
        rows = random_tree(rng, links)
        tree, (model, at) = tree_of(rows), in_pinocchio(pin, rows)
        data, m = model.createData(), model.nv
        assert tree.coordinates == m
        q, v, a = motions(rng, scale, 5, m)
        effort, weight, matrix = tree.inverse_dynamics(q, v, a), tree.gravity(q), tree.mass_matrix(q)
        places, back = tree.placements(q), tree.forward_dynamics(q, v, effort)
        kinetic, potential = tree.energy(q, v)
        nothing = np.zeros(m)
        potential0 = []
        for i in range(5):
            close(effort[i], pin.rnea(model, data, q[i], v[i], a[i]))
            close(weight[i], pin.computeGeneralizedGravity(model, data, q[i]))
            # Columns of efforts, because Pinocchio's crba wants joints added depth first.
            g = pin.rnea(model, data, q[i], nothing, nothing)
            columns = np.array([pin.rnea(model, data, q[i], nothing, e) - g for e in np.eye(m)])
            close(matrix[i], columns)
            close(kinetic[i], 0.5 * v[i] @ columns @ v[i])
            close(back[i], a[i], 1e-9)
            potential0.append(pin.computePotentialEnergy(model, data, q[i]))
            pin.forwardKinematics(model, data, q[i])
            for k, (joint, here) in enumerate(at):
                close(places[i, k], (data.oMi[joint] * here).homogeneous[:3])
        # What hangs on the base without a joint is not among Pinocchio's bodies: a constant.
        close(potential - potential[0], np.array(potential0) - potential0[0])


def test_energy_of_height_has_pinocchios_zero(rng, pin):
    rows = random_tree(rng, 4, kinds=(REVOLUTE, PRISMATIC))
    tree, (model, _) = tree_of(rows), in_pinocchio(pin, rows)
    q = rng.uniform(-3, 3, 4)
    close(tree.energy(q, q)[1], pin.computePotentialEnergy(model, model.createData(), q))


@pytest.mark.parametrize("scale", POINTS.values(), ids=POINTS)
def test_regressor_is_pinocchios(rng, pin, scale):
    for links in (1, 2, 6, 7):
        rows = random_tree(rng, links, kinds=(REVOLUTE, PRISMATIC))
        tree, (model, _) = tree_of(rows), in_pinocchio(pin, rows)
        data = model.createData()
        q, v, a = motions(rng, scale, 11, links)
        found = tree.regressor(q, v, a).reshape(11, links, links, 10)[..., PINOCCHIO_ORDER]
        for i in range(11):
            close(found[i], pin.computeJointTorqueRegressor(model, data, q[i], v[i], a[i]).reshape(links, links, 10))


def test_jacobian_is_pinocchios(rng, pin):
    rows = random_tree(rng, 7, kinds=(REVOLUTE, PRISMATIC))
    tree, (model, at) = tree_of(rows), in_pinocchio(pin, rows)
    q, point = rng.uniform(-3, 3, 7), rng.normal(size=3)
    for link, (joint, _) in enumerate(at):
        frame = pin.Frame("f", joint, 0, pin.SE3(np.eye(3), point), pin.FrameType.OP_FRAME)
        with_frame = model.copy()
        index = with_frame.addFrame(frame)
        wanted = pin.computeFrameJacobian(with_frame, with_frame.createData(), q, index, pin.LOCAL_WORLD_ALIGNED)
        close(tree.jacobian(q, link, point), wanted)


def test_forward_dynamics_are_pinocchios(rng, pin):
    rows = random_tree(rng, 6, kinds=(REVOLUTE, PRISMATIC), serial=True)
    rows[:, INDEX["rotor_inertia"]] = 0.0
    tree, (model, _) = tree_of(rows), in_pinocchio(pin, rows)
    q, v, effort = rng.uniform(-3, 3, (3, 6))
    close(tree.forward_dynamics(q, v, effort), pin.aba(model, model.createData(), q, v, effort), 1e-10)


def test_effort_is_linear_in_bodies(rng):
    for _ in range(20):
        rows = random_tree(rng, int(rng.integers(1, 9)))
        tree = tree_of(rows)
        q, v, a = motions(rng, 1.0, 9, tree.coordinates)
        rotors = rows[rows[:, INDEX["joint"]] != FIXED, INDEX["rotor_inertia"]]
        close(tree.regressor(q, v, a) @ rows[:, INDEX["mass"] :].ravel() + rotors * a, tree.inverse_dynamics(q, v, a))


def test_held_joints_do_not_accelerate_and_pass_their_effort_on(rng):
    rows = random_tree(rng, 6, kinds=(REVOLUTE, PRISMATIC))
    tree = tree_of(rows)
    q, v, effort = rng.uniform(-3, 3, (3, 8, 6))
    held = np.array([False, True, False, True, False, False])
    a = tree.forward_dynamics(q, v, effort, held=held)
    assert (a[:, held] == 0.0).all()
    close(tree.inverse_dynamics(q, v, a)[:, ~held], effort[:, ~held], 1e-10)


def test_energy_is_conserved(rng):
    """A branched tree swings for two seconds under nothing but its weight, by Runge and Kutta."""
    rows = random_tree(rng, 5, kinds=(REVOLUTE,))
    tree = tree_of(rows)
    q, v = rng.uniform(-1, 1, 5), rng.uniform(-1, 1, 5)
    none, h = np.zeros(5), 2.5e-4
    start = sum(tree.energy(q, v))
    exchanged = 0.0

    def slope(q, v):
        return v, tree.forward_dynamics(q, v, none)

    for _ in range(8000):
        k1 = slope(q, v)
        k2 = slope(q + h / 2 * k1[0], v + h / 2 * k1[1])
        k3 = slope(q + h / 2 * k2[0], v + h / 2 * k2[1])
        k4 = slope(q + h * k3[0], v + h * k3[1])
        q, v = (x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q, v), k1, k2, k3, k4, strict=True))
        exchanged = max(exchanged, tree.energy(q, v)[0])
    assert exchanged > 1.0
    assert abs(sum(tree.energy(q, v)) - start) < 1e-8 * exchanged


def test_normal_equations_are_those_of_the_stored_rows(rng):
    for n in (1, 7, 64, 65, 300):
        rows = random_tree(rng, 5)
        tree = tree_of(rows)
        m = tree.coordinates
        q, v, a = motions(rng, 1.0, n, m)
        effort, weight = rng.normal(size=(n, m)), rng.uniform(0, 2, (n, m))
        own, shared = rng.normal(size=(n, m, 3)), rng.normal(size=(n, m, 2))
        y = tree.regressor(q, v, a, own=own, shared=shared)
        assert y.shape == (n, m, 50 + 3 * m + 2)
        for k in range(m):
            columns = y[:, k, 50 : 50 + 3 * m].reshape(n, m, 3)
            np.testing.assert_array_equal(columns[:, k], own[:, k])
            assert (np.delete(columns, k, axis=1) == 0).all()
        np.testing.assert_array_equal(y[..., -2:], shared)
        normal, projected, square = tree.normal_equations(q, v, a, effort, weight=weight, own=own, shared=shared)
        wide = (y * np.sqrt(weight)[..., None]).reshape(n * m, -1)
        target = (effort * np.sqrt(weight)).ravel()
        close(normal, wide.T @ wide, 1e-13)
        close(projected, wide.T @ target, 1e-13)
        close(square, target @ target, 1e-13)
        plain = tree.normal_equations(q, v, a, effort)
        close(plain[0], y[..., :50].reshape(-1, 50).T @ y[..., :50].reshape(-1, 50), 1e-13)


def test_what_has_no_weight_is_not_read(rng):
    rows = random_tree(rng, 3, kinds=(REVOLUTE,))
    tree = tree_of(rows)
    q, v, a = motions(rng, 1.0, 20, 3)
    effort, weight = rng.normal(size=(20, 3)), np.ones((20, 3))
    weight[4], weight[7, 1] = 0.0, 0.0
    wanted = tree.normal_equations(q, v, a, effort, weight=weight)
    effort[4], effort[7, 1], q[4], a[4] = np.nan, np.inf, np.nan, np.inf
    for found, expected in zip(tree.normal_equations(q, v, a, effort, weight=weight), wanted, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_a_sample_alone_has_the_bits_of_many(rng):
    rows = random_tree(rng, 7)
    tree = tree_of(rows)
    q, v, a = motions(rng, 1.0, 13, tree.coordinates)
    many = tree.inverse_dynamics(q, v, a)
    np.testing.assert_array_equal([tree.inverse_dynamics(*one) for one in zip(q, v, a, strict=True)], many)
    np.testing.assert_array_equal([tree.regressor(*one) for one in zip(q, v, a, strict=True)], tree.regressor(q, v, a))
    np.testing.assert_array_equal([tree.mass_matrix(one) for one in q], tree.mass_matrix(q))


PRINT_BITS = """
import hashlib, sys
import numpy as np
sys.path.insert(0, {folder!r})
from trees import random_tree, tree_of
rng = np.random.default_rng(5)
h = hashlib.sha256()
for links in (1, 3, 6, 8):
    tree = tree_of(random_tree(rng, links))
    q, v, a = rng.uniform(-3, 3, (3, 101, tree.coordinates))
    effort = tree.inverse_dynamics(q, v, a)
    for part in (effort, tree.mass_matrix(q), tree.forward_dynamics(q, v, effort), tree.regressor(q, v, a),
                 tree.placements(q), *tree.energy(q, v), *tree.normal_equations(q, v, a, effort)[:2]):
        h.update(np.ascontiguousarray(part).tobytes())
print(h.hexdigest())
"""


def test_bits_are_the_same_for_every_instruction_set():
    found = set()
    for level in ("baseline", "avx2", "avx512"):
        code = PRINT_BITS.format(folder=os.path.dirname(__file__))
        made = subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"PELLUCID_INSTRUCTIONS": level},
            capture_output=True,
            text=True,
            check=True,
        )
        found.add(made.stdout)
    assert len(found) == 1


def test_nan_stays_in_its_sample(rng):
    tree = tree_of(random_tree(rng, 4, kinds=(REVOLUTE,)))
    q, v, a = motions(rng, 1.0, 9, 4)
    whole = tree.inverse_dynamics(q, v, a)
    q[3, 1] = np.nan
    found = tree.inverse_dynamics(q, v, a)
    assert np.isnan(found[3]).any()
    np.testing.assert_array_equal(np.delete(found, 3, axis=0), np.delete(whole, 3, axis=0))


def test_into_the_callers_array(rng):
    tree = tree_of(random_tree(rng, 3, kinds=(REVOLUTE,)))
    q, v, a = motions(rng, 1.0, 10, 3)
    out = np.full((10, 3, 30), np.nan)
    assert tree.regressor(q, v, a, out=out) is out
    np.testing.assert_array_equal(out, tree.regressor(q, v, a))
    for wrong in (np.zeros((10, 3, 29)), np.zeros((10, 3, 60))[..., ::2], np.zeros((10, 3, 30), np.float32)):
        with pytest.raises(ValueError, match="out: "):
            tree.regressor(q, v, a, out=wrong)
    read_only = np.zeros((10, 3, 30))
    read_only.flags.writeable = False
    with pytest.raises(ValueError, match="out: expected a writable"):
        tree.regressor(q, v, a, out=read_only)


def test_arguments_are_checked(rng):
    rows = random_tree(rng, 3, kinds=(REVOLUTE,))
    tree = tree_of(rows)
    with pytest.raises(ValueError, match=r"position: got shape \(4, 2\), expected \(n, 3\)"):
        tree.gravity(np.zeros((4, 2)))
    with pytest.raises(ValueError, match=r"velocity: got shape \(3, 3\), expected \(4, 3\), as position"):
        tree.inverse_dynamics(np.zeros((4, 3)), np.zeros((3, 3)), np.zeros((4, 3)))
    with pytest.raises(ValueError, match="link: expected a whole number from 0 to 2"):
        tree.jacobian(np.zeros(3), 3)
    for name, value, message in (
        ("parent", 3.0, "link 3: parent: expected 0 for the base or the number of an earlier link"),
        ("parent", 0.5, "link 3: parent"),
        ("joint", 3.0, "link 3: joint: expected 0"),
        ("x", np.nan, "link 3: expected finite numbers"),
    ):
        wrong = rows.copy()
        wrong[2, INDEX[name]] = value
        with pytest.raises(ValueError, match=message):
            tree_of(wrong)
    wrong = rows.copy()
    wrong[1, INDEX["axis_x"] : INDEX["axis_z"] + 1] = 0.0
    with pytest.raises(ValueError, match="expected an axis of a length above 0"):
        tree_of(wrong)
    with pytest.raises(ValueError, match="from 1 to 32"):
        tree_of(np.zeros((33, len(INDEX))))
    with pytest.raises(ValueError, match="gravity: got shape"):
        _core.KinematicTree(rows, GRAVITY[:2])
