"""Two real robots of six joints identified whole: what their data's READMEs state, and what is predicted beyond."""

import numpy as np
import pytest

from pellucid.arm.fit.fit_tree import identify_tree
from pellucid.arm.fit.tree_estimate import parameter_verdict
from pellucid.arm.study.recorded_tree import recorded_tree
from pellucid.study.datasets import init

pytestmark = pytest.mark.slow

VISCOUS = [8.05, 5.53, 1.97, 1.11, 1.86, 0.65]  # of Staubli TX40, published
COULOMB = [7.14, 8.26, 6.34, 2.48, 3.03]  # joint 6's is among the numbers that the record hardly shows


def identified(name, data_folder, tmp_path_factory, **options):
    if not (data_folder / name).is_dir():
        pytest.skip(f"{data_folder / name} is not here")
    robot, motions = recorded_tree(init(tmp_path_factory.mktemp(name) / "study", name))
    fitted = [m for m in motions if m.use == "fit" and m.payload is None]
    judged = [m for m in motions if m.use == "validate" and m.payload is None]
    return identify_tree(robot, fitted, judged, width=0.02, **options)


@pytest.fixture(scope="module")
def staubli(data_folder, tmp_path_factory):
    return identified("staubli_tx40", data_folder, tmp_path_factory)


@pytest.fixture(scope="module")
def ur10e(data_folder, tmp_path_factory):
    return identified("ur10e", data_folder, tmp_path_factory, leave_out=False)


def test_base_parameters_are_counted_as_stated(staubli, ur10e):
    for found, numbers in ((staubli, 61), (ur10e, 58)):
        assert found.rows.base.rigid == 36
        assert sum(name.endswith(".rotor_inertia") for name in found.rows.base.names) == 4
        assert len(found.base.parameters) == numbers


def test_friction_is_near_what_was_published(staubli):
    base = staubli.base
    viscous = [base[f"joint_{k}.viscous"].value for k in range(1, 7)]
    viscous[4] += base["joint_6.motor_viscous"].value  # the published ones are those of all that turns with a joint
    viscous[5] += base["joint_6.motor_viscous"].value
    np.testing.assert_allclose(viscous, VISCOUS, rtol=0.05)
    np.testing.assert_allclose([base[f"joint_{k}.coulomb"].value for k in range(1, 6)], COULOMB, rtol=0.08)
    assert base["joint_6.motor_coulomb"].value == pytest.approx(1.95, rel=0.08)


def test_segments_that_took_no_part(staubli):
    assert staubli.base_out.mean <= 9.0
    assert staubli.best_out.mean <= 7.5
    assert staubli.best_out.errors[3] <= 5.0
    assert all(any(r.motor == 3 and abs(r.order - 30.65) < 0.1 for r in m.ripples) for m in staubli.best_out.models)


def test_intervals_are_those_of_the_jackknife_within_two(staubli):
    assert staubli.jackknife.share_within >= 80.0
    assert staubli.jackknife.textbook_ratio > 4.0
    states = [parameter_verdict(p) for p in staubli.base.parameters.values()]
    assert 15 <= states.count("weak") <= 35  # small products of inertia cannot be read off this record


def test_recordings_that_took_no_part(ur10e):
    best = ur10e.heldout["best"]
    assert best[1] <= 2.0
    assert best[2] <= 2.7
    assert best.mean() <= 4.3
    assert best.mean() < ur10e.heldout["base"].mean()
