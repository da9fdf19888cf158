"""Where a limb must be for its strap to pull as it does: the equation in plain NumPy, solved backwards by the core."""

import numpy as np
import pytest

from pellucid import _core

NAMES = _core.STRAP_PARAMETER_NAMES
PERIOD = 0.002
EXAMPLE = dict(strap_stiffness=20.0, strap_damping=0.5, strap_hold=100.0)
OPTIONS = {
    "plain": {},
    "hardening": dict(strap_hardening=0.15),
    "slack": dict(strap_slack=0.05),
    "relaxing": dict(strap_relaxing_stiffness=12.0, strap_relaxation_time=0.7),
    "askew": dict(strap_across=0.12, strap_along=-0.1, strap_fitted=0.3),
    "creeping": dict(strap_hold=1.0, strap_mobility=0.01),
}
EVERYTHING = {name: value for option in OPTIONS.values() for name, value in option.items()}


def parameters(**changes):
    values = dict.fromkeys(NAMES, 0.0) | EXAMPLE | changes
    return np.array([values[name] for name in NAMES])


def worked(values, n=4000):
    """A robot, a limb that stretches the strap, and the torque on the robot: the strap's equation, written out."""
    p = dict(zip(NAMES, values, strict=True))
    t = PERIOD * np.arange(n)
    robot = 0.5 + 0.4 * np.sin(4.7 * t)
    apart = 0.2 * np.sin(4.7 * t + 1.9) + 0.04 * np.sin(11.0 * t)
    rate = 0.2 * 4.7 * np.cos(4.7 * t + 1.9) + 0.04 * 11.0 * np.cos(11.0 * t)
    half = 0.5 * p["strap_slack"]
    e = apart - np.clip(apart, -half, half)
    flow = np.zeros(n)
    flow[0] = e[0]
    time = p["strap_relaxation_time"]
    for i in range(n - 1):
        keep = np.exp(-PERIOD / time) if time else 0.0
        flow[i + 1] = keep * flow[i] + (1.0 - keep) * 0.5 * (e[i] + e[i + 1])
    curved = e**3 / (3.0 * p["strap_hardening"] ** 2) if p["strap_hardening"] else 0.0
    pull = p["strap_stiffness"] * (e + curved) + p["strap_damping"] * rate + p["strap_relaxing_stiffness"] * (e - flow)
    if half:
        pull = np.where(e * pull <= 0.0, 0.0, pull)
    beyond = pull - np.clip(pull, -p["strap_hold"], p["strap_hold"])
    slip = p["strap_mobility"] * PERIOD * np.cumsum(beyond)
    off = p["strap_along"] * (np.sin(robot) - np.sin(p["strap_fitted"]))
    off -= p["strap_across"] * (np.cos(robot) - np.cos(p["strap_fitted"]))
    lever = 1.0 + p["strap_along"] * np.cos(robot) + p["strap_across"] * np.sin(robot)
    return robot, robot + off + apart + slip, lever * pull, e, pull


@pytest.mark.parametrize("option", [*OPTIONS, "everything"])
def test_the_limb_is_found_again_from_the_torque(option):
    values = parameters(**(EVERYTHING if option == "everything" else OPTIONS[option]))
    robot, limb, torque, stretch, against = worked(values)
    found, stretched, pull, _ = _core.strap_response(
        values, robot, torque, period=PERIOD, still=0.02, active=np.zeros(0, np.int64)
    )
    pulls = np.convolve(np.abs(torque) <= 0.02, np.ones(81), "same") < 0.5
    pulls[:500] = False
    assert pulls.mean() > 0.4
    assert np.abs(found - limb)[pulls].max() < 2e-3
    assert np.abs(stretched - stretch)[pulls].max() < 2e-3
    assert np.abs(pull - against).max() < 1e-12
    assert np.std(limb - robot) > 0.1


def test_friction_beside_the_spring_and_tissue_in_series_are_solved():
    values = parameters()
    robot, limb, torque, *_ = worked(values)
    rate = np.gradient(limb - robot, PERIOD)
    level, depth, firm = 0.6, 0.03, 0.8
    given = torque + level * np.sign(rate)
    found = _core.strap_response(
        values, robot, given, period=PERIOD, still=0.0, active=[], contact=[level, 0.0, depth, firm]
    )[0]
    expected = limb + depth * np.arcsinh(given / firm)
    assert np.abs(found - expected)[500:].max() < 3e-3
    assert np.abs(expected - limb).max() > 0.05


def test_cloth_that_rubs_bends_before_it_slips():
    """An elastic-plastic element beside the spring; friction that jumps left a strap of cloth taken for tissue."""
    values = parameters()
    robot, limb, torque, stretch, _ = worked(values)
    level, way = 0.6, 0.02
    bend = np.zeros(len(stretch))
    for i in range(1, len(stretch)):
        bend[i] = np.clip(bend[i - 1] + (stretch[i] - stretch[i - 1]) / way, -1.0, 1.0)
    given = torque + level * bend
    found = _core.strap_response(
        values, robot, given, period=PERIOD, still=0.0, active=[], contact=[level, way, 0.0, 0.0]
    )[0]
    assert np.abs(found - limb)[500:].max() < 1e-3
    (way_slope,) = _core.strap_response(
        values, robot, given, period=PERIOD, still=0.0, active=[len(NAMES) + 1], contact=[level, way, 0.0, 0.0]
    )[3].T
    ends = [
        _core.strap_response(
            values, robot, given, period=PERIOD, still=0.0, active=[], contact=[level, way + step, 0.0, 0.0]
        )[0]
        for step in (1e-7, -1e-7)
    ]
    difference = (ends[0] - ends[1]) / 2e-7
    assert np.quantile(np.abs(way_slope - difference), 0.95) < 1e-3 * np.abs(difference).max()
    at_once = _core.strap_response(
        values, robot, given, period=PERIOD, still=0.0, active=[], contact=[level, 0.0, 0.0, 0.0]
    )[0]
    assert np.abs(at_once - limb)[500:].max() > 0.01


def test_derivatives_are_those_of_differences():
    values = parameters(**EVERYTHING)
    robot, _, torque, *_ = worked(values, 1500)
    active = [i for i, name in enumerate(NAMES) if values[i] and name != "strap_fitted"]
    *_, slopes = _core.strap_response(values, robot, torque, period=PERIOD, still=0.02, active=np.array(active))
    for column, i in zip(slopes.T, active, strict=True):
        step = 1e-5 * abs(values[i])
        ends = []
        for sign in (1.0, -1.0):
            moved = values.copy()
            moved[i] += sign * step
            ends.append(_core.strap_response(moved, robot, torque, period=PERIOD, still=0.02, active=np.array([0]))[0])
        slope = (ends[0] - ends[1]) / (2.0 * step)
        assert column == pytest.approx(slope, abs=2e-4 * np.abs(slope).max() + 1e-12), NAMES[i]


def test_nothing_strapped_on_and_no_number_give_no_endless_loop():
    robot, torque = np.linspace(0.0, 1.0, 50), np.full(50, np.nan)
    for values in (np.zeros(len(NAMES)), parameters(**EVERYTHING)):
        for pull in (torque, np.full(50, np.inf), np.zeros(50)):
            found = _core.strap_response(values, robot, pull, period=PERIOD, still=0.0, active=np.array([0]))[0]
            assert found.shape == (50,)
    assert np.isfinite(found).all()


def test_what_it_is_given_is_checked():
    given = dict(period=PERIOD, still=0.0, active=np.array([0]))
    with pytest.raises(ValueError, match="torque: got shape"):
        _core.strap_response(parameters(), np.zeros(4), np.zeros(3), **given)
    with pytest.raises(ValueError, match="period"):
        _core.strap_response(parameters(), np.zeros(4), np.zeros(4), **(given | {"period": 0.0}))
