"""Least squares in its three forms: they find what is there, and refuse what is not."""

import weakref
from dataclasses import replace

import numpy as np
import pytest
from motions import TRUTH, motion_of, vector_of

from pellucid._errors import IdentificationError
from pellucid.joint.fit.drive_constant import estimate_drive_constant
from pellucid.joint.fit.friction_solver import solve_family, solve_robust, solve_weighted
from pellucid.joint.fit.recording_agreement import enforce_pseudo_inertia, least_inertia
from pellucid.joint.study.joint_faults import require_sign
from pellucid.models.joint import JointModel, joint_model
from pellucid.numerics import regression
from pellucid.numerics.motion import Filtering
from pellucid.numerics.regression import regression_rows, stack


def model(family="symmetric", **options):
    return joint_model(family, **({"motion": "rotary", "effort_unit": "N*m", "gravity": "sine"} | options))


def values_of(found, which):
    return dict(zip(which.names, found.values, strict=True))


def test_ordinary_least_squares_is_exact_without_noise():
    found = values_of(solve_family(model(), stack([motion_of(vector_of())])), model())
    expected = {"inertia": 0.08, "gravity": 3.0, "viscous": 0.2, "coulomb": 0.5, "offset": 0.1}
    assert found == pytest.approx(expected, rel=1e-9)


def test_it_equals_numpys_least_squares_on_a_plain_regressor():
    motion = motion_of(vector_of(), effort_sd=0.3)
    v = motion.velocity
    plain = np.stack([motion.acceleration, np.sin(motion.position), v, np.sign(v), np.ones_like(v)], axis=1)
    expected = np.linalg.lstsq(plain, motion.effort, rcond=None)[0]
    assert solve_family(model(), stack([motion])).values == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("family", "changes"),
    [
        ("directional", {"offset": 0.0, "coulomb_positive": 0.6, "viscous_negative": 0.3}),
        ("load", {"load_motoring": 0.08, "load_generating": 0.08}),
        ("stribeck", {"stribeck": 0.2, "stribeck_velocity": 0.1}),
    ],
)
def test_every_family_finds_its_own_truth(family, changes):
    truth = vector_of(**changes)
    which = model(family)
    found = solve_family(which, stack([motion_of(truth), motion_of(truth, seed=2)]))
    assert which.vector(found.values) == pytest.approx(truth, rel=1e-4, abs=1e-5)


def test_no_regressor_of_a_nonlinear_search_is_computed_twice(monkeypatch):
    asked = []
    plain = JointModel.rows

    def rows(self, values, motion):
        asked.append((self.names, values.tobytes()))
        return plain(self, values, motion)

    monkeypatch.setattr(JointModel, "rows", rows)
    which, data = model("load"), stack([motion_of(vector_of(load_motoring=0.08, load_generating=0.08))])
    found = solve_family(which, data)
    assert len(asked) == len(set(asked)) == found.iterations + 1  # and one of the linear part
    jacobian, effort = regression_rows(which, found.values, data)
    assert found.jacobian == pytest.approx(jacobian, rel=1e-12)
    assert found.residual == pytest.approx(data.target - effort, abs=1e-12)


@pytest.fixture
def alive(monkeypatch):
    """Return a list of how many regressors are in memory whenever one is made."""
    made, alive = [], []

    def rows(*arguments):
        found = regression_rows(*arguments)
        made.append(weakref.ref(found[0]))
        alive.append(sum(each() is not None for each in made))
        return found

    monkeypatch.setattr(regression, "regression_rows", rows)
    return alive


def test_a_nonlinear_search_keeps_no_regressor_but_the_best(alive):
    """Hours of data would not fit in memory once for each evaluation."""
    which, data = model("load"), stack([motion_of(vector_of(load_motoring=0.08, load_generating=0.08))])
    start = solve_family(which, data).values * 1.5
    alive.clear()
    regression.solve(which, data, start=start)
    assert len(alive) > 3
    assert max(alive) == 2  # the best one, and the one that is tried


def test_a_profile_over_stribeck_velocities_keeps_no_regressor(alive):
    solve_family(model("stribeck"), stack([motion_of(vector_of(stribeck=0.2, stribeck_velocity=0.1))]))
    assert len(alive) > 6
    assert max(alive) == 1


def test_a_known_gravity_tells_motoring_from_generating_load_friction():
    truth = vector_of(load_motoring=0.10, load_generating=0.03)
    which = model("load", known={"gravity": TRUTH["gravity_sine"]}, separate_load=True)
    found = values_of(solve_family(which, stack([motion_of(truth), motion_of(truth, seed=2)])), which)
    assert found["load_motoring"] == pytest.approx(0.10, rel=1e-3)
    assert found["load_generating"] == pytest.approx(0.03, rel=1e-3)


def test_negative_friction_is_refused_by_the_bounds_and_allowed_without_them():
    data = stack([motion_of(vector_of(viscous_positive=-0.05, viscous_negative=-0.05))])
    bounded, free = solve_family(model(), data), solve_family(model(), data, consistent=False)
    at = model().names.index("viscous")
    assert bounded.values[at] == 0.0
    assert bounded.at_bound[at]
    assert free.values[at] == pytest.approx(-0.05)
    assert not free.at_bound[at]


def test_robust_least_squares_shrugs_off_outliers():
    motion = motion_of(vector_of(), effort_sd=0.02)
    spoiled = motion.effort.copy()
    spoiled[::37] += 8.0
    data = stack([replace(motion, effort=spoiled)])
    plain = solve_family(model(), data)
    robust = solve_robust(model(), data, plain)
    at = model().names.index("offset")
    assert abs(plain.values[at] - 0.1) > 0.15
    assert robust.values[at] == pytest.approx(0.1, abs=0.01)
    assert robust.converged


def test_weighted_least_squares_listens_to_the_quieter_recording():
    quiet, loud = motion_of(vector_of(), effort_sd=0.01), motion_of(vector_of(), seed=3, effort_sd=2.0, name="loud")
    data = stack([quiet, loud])
    truth = np.array([0.08, 3.0, 0.2, 0.5, 0.1])
    plain = solve_family(model(), data)
    weighted = solve_weighted(model(), data, plain)
    assert np.linalg.norm((weighted.values - truth) / truth) < 0.2 * np.linalg.norm((plain.values - truth) / truth)


def test_constant_velocity_cannot_show_inertia():
    motion = motion_of(vector_of())
    time = motion.time
    steady = replace(motion, position=0.1 * time, velocity=np.full_like(time, 0.1), acceleration=np.zeros_like(time))
    with pytest.raises(IdentificationError, match="inertia cannot be identified: nothing in the recordings excites"):
        solve_family(model(), stack([steady]))


def test_collinear_effects_are_named():
    motion = motion_of(vector_of())
    one_way = replace(motion, velocity=np.abs(motion.velocity) + 0.01)
    with pytest.raises(IdentificationError, match="coulomb and offset are not identifiable separately"):
        solve_family(model(), stack([one_way]))


def test_too_few_samples_are_refused():
    motion = motion_of(vector_of(), seconds=0.02)
    with pytest.raises(IdentificationError, match="4 usable samples"):
        solve_family(model(), stack([motion]))


def test_a_dead_band_above_every_speed_is_refused():
    with pytest.raises(IdentificationError, match="none is faster than the dead band, and the fastest moves at"):
        stack([replace(motion_of(vector_of()), filtering=Filtering(None, dead_band=100.0))])


def test_nothing_to_fit_is_refused():
    with pytest.raises(IdentificationError, match='use = "fit"'):
        stack([])


def test_the_pseudo_inertia_condition_moves_the_inertia_and_says_so():
    data = stack([motion_of(vector_of(inertia=0.02), effort_sd=0.05)])
    found = solve_family(model(), data)
    mass = 1.5
    least = least_inertia(model(), found.values, mass)
    assert least == pytest.approx((3.0 / 9.80665) ** 2 / mass, rel=0.05)
    assert found.values[0] < least
    after, notes = enforce_pseudo_inertia(model(), data, found, mass)
    assert notes == ("inertia is at its lower bound for a mass of 1.5 kg with this gravity torque",)
    assert after.values[0] == pytest.approx(least_inertia(model(), after.values, mass), rel=1e-6)
    assert after.at_bound[0]
    # The constrained optimum costs less than simply raising the inertia.
    raised = found.values.copy()
    raised[0] = least
    naive = found.residual - found.jacobian @ (raised - found.values)
    assert np.sum(after.residual**2) < np.sum(naive**2)


def test_a_consistent_solution_is_left_alone():
    data = stack([motion_of(vector_of(), effort_sd=0.05)])
    found = solve_family(model(), data)
    same, notes = enforce_pseudo_inertia(model(), data, found, 10.0)
    assert not notes
    assert same is found


def test_the_drive_constant_comes_from_two_payloads():
    gain = 1.7
    data = stack(
        [
            motion_of(vector_of(), gain=gain, effort_sd=0.02),
            motion_of(vector_of(), gain=gain, effort_sd=0.02, seed=4, payload=(2.0, 0.15), name="loaded"),
        ]
    )
    found = estimate_drive_constant(model(effort_unit="A"), data)
    assert found.unit == "N*m/A"
    low, high = found.interval()
    assert low < gain < high
    assert high - low < 0.05


def test_one_payload_cannot_give_the_drive_constant():
    data = stack([motion_of(vector_of(), payload=(2.0, 0.15))])
    with pytest.raises(IdentificationError, match="at least two different payloads"):
        estimate_drive_constant(model(effort_unit="A"), data)


def test_a_reversed_drive_is_named():
    motion = motion_of(vector_of(), effort_sd=0.05)
    require_sign(model(), stack([motion]), "current")
    with pytest.raises(IdentificationError, match=r"absorbs [\d.]+ J of work .* set sign = -1 on channel 'current'"):
        require_sign(model(), stack([replace(motion, effort=-motion.effort)]), "current")


def test_the_factor_of_many_rows_has_the_solution_of_all(monkeypatch):
    rng = np.random.default_rng(1)
    w, y = rng.standard_normal((1000, 4)), rng.standard_normal(1000)
    expected = np.linalg.lstsq(w, y, rcond=None)[0]
    for count in (64, 300, 1000, 5000):
        monkeypatch.setattr(regression, "ROWS_AT_ONCE", count)
        factor = regression.triangular_factor(w, y)
        assert factor.shape == (5, 5)
        np.testing.assert_allclose(np.linalg.solve(factor[:4, :4], factor[:4, 4]), expected, rtol=1e-12)
        np.testing.assert_allclose(factor[4, 4] ** 2, np.sum((y - w @ expected) ** 2), rtol=1e-12)
        bounds = np.full(4, -np.inf), np.full(4, np.inf)
        np.testing.assert_allclose(regression.least_squares_within(w, y, *bounds), expected, rtol=1e-12)


@pytest.mark.parametrize("seed", range(30))
def test_bounded_least_squares_end_on_bounds_where_no_step_reduces_the_sum(seed):
    rng = np.random.default_rng(seed)
    p = int(rng.integers(1, 10))
    w = rng.standard_normal((3 * p, p)) @ (np.eye(p) + rng.standard_normal((p, p)) * (seed % 3))
    w *= 10.0 ** rng.uniform(-3, 3, p)
    norms = np.linalg.norm(w, axis=0)
    y = rng.standard_normal(3 * p)
    lower = np.where(rng.random(p) < 0.3, -np.inf, rng.uniform(-0.3, 0.3, p) / norms)
    upper = np.maximum(lower, 0.0) + rng.choice([0.0, 0.2, np.inf], p) / norms
    x = regression.least_squares_within(w, y, lower, upper)
    assert np.all((x >= lower) & (x <= upper))
    slope = (w / norms).T @ (y - w @ x)
    assert np.all(slope[x < upper] < 1e-12)
    assert np.all(slope[x > lower] > -1e-12)
