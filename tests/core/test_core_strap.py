"""The strap: against SciPy's integration of its equations, and no closed motion gains from it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pellucid import _core

NAMES = _core.STRAP_PARAMETER_NAMES
EXAMPLE = dict(strap_stiffness=20.0, strap_damping=0.5, strap_hold=100.0)
OPTIONS = {
    "plain": {},
    "hardening": dict(strap_hardening=0.15),
    "slack": dict(strap_slack=0.06),
    "relaxing": dict(strap_relaxing_stiffness=12.0, strap_relaxation_time=0.7),
    "creeping": dict(strap_hold=1.0, strap_mobility=0.08),
    "askew": dict(strap_across=0.12, strap_along=-0.1, strap_fitted=0.3),
}
EVERYTHING = {name: value for option in OPTIONS.values() for name, value in option.items()}


def parameters(**changes):
    values = dict.fromkeys(NAMES, 0.0) | EXAMPLE | changes
    assert set(values) == set(NAMES)
    return np.array([values[name] for name in NAMES])


def motion(n, period, seed=0):
    """Robot and limb, smooth, far enough apart to work every option: angles [rad] and their rates [rad/s]."""
    rng, t = np.random.default_rng(seed), period * np.arange(n)
    found = []
    for size in (0.5, 0.2):
        amplitude, frequency, phase = size * rng.uniform(0.3, 1.0, 4), rng.uniform(0.5, 9.0, 4), rng.uniform(0, 6.3, 4)
        angle = frequency * t[:, None] + phase
        found += [np.sin(angle) @ amplitude, np.cos(angle) @ (amplitude * frequency)]
    robot, robot_rate, apart, apart_rate = found
    return robot, robot_rate, robot + apart, robot_rate + apart_rate


def plain(p, robot, robot_rate, limb, limb_rate, period):
    """The same by SciPy: torque against the limb and on the robot."""
    p = dict(zip(NAMES, p, strict=True))
    t = period * np.arange(len(robot))
    off = p["strap_along"] * np.sin(robot) - p["strap_across"] * np.cos(robot)
    off -= p["strap_along"] * np.sin(p["strap_fitted"]) - p["strap_across"] * np.cos(p["strap_fitted"])
    lever = 1 + p["strap_along"] * np.cos(robot) + p["strap_across"] * np.sin(robot)
    mismatch, rate = limb - robot - off, limb_rate - lever * robot_rate

    def pull(mismatch, rate, slip, flow):
        e = np.sign(mismatch - slip) * np.maximum(np.abs(mismatch - slip) - 0.5 * p["strap_slack"], 0)
        doubled = p["strap_hardening"] or np.inf
        tau = p["strap_stiffness"] * (e + e**3 / (3 * doubled**2)) + p["strap_damping"] * rate
        tau = tau + p["strap_relaxing_stiffness"] * (e - flow)
        return e, np.where((p["strap_slack"] > 0) & (e * tau <= 0), 0.0, tau)

    def slope(now, state):
        e, tau = pull(np.interp(now, t, mismatch), np.interp(now, t, rate), *state)
        beyond = np.sign(tau) * max(abs(tau) - p["strap_hold"], 0.0)
        relaxes = (e - state[1]) / p["strap_relaxation_time"] if p["strap_relaxing_stiffness"] else 0.0
        return [p["strap_mobility"] * beyond, relaxes]

    start = [0.0, pull(mismatch[0], 0.0, 0.0, 0.0)[0] if p["strap_relaxing_stiffness"] else 0.0]
    solved = solve_ivp(slope, (0.0, t[-1]), start, t_eval=t, rtol=1e-8, atol=1e-10, max_step=4 * period)
    tau = pull(mismatch, rate, *solved.y)[1]
    return tau, lever * tau, solved.y[0]


@pytest.mark.parametrize("options", [*OPTIONS.values(), EVERYTHING], ids=[*OPTIONS, "everything"])
def test_it_is_what_scipy_integrates(options):
    period = 1e-4
    p, moved = parameters(**options), motion(20_000, period)
    got, wanted = _core.strap_torque(p, *moved, period=period), plain(p, *moved, period)
    for ours, theirs, size in zip(got, wanted, (np.ptp(wanted[0]), np.ptp(wanted[0]), 1.0), strict=True):
        # Of first order in the period, and a moment late where slack lets go.
        assert np.quantile(np.abs(ours - theirs), 0.999) < 2e-3 * size
    linear = _core.strap_torque(parameters(), *moved, period=period)[0]
    assert not options or np.max(np.abs(got[0] - linear)) > 0.02 * np.ptp(linear)


def test_what_is_off_is_the_spring_and_the_damper():
    q_e, v_e, q_k, v_k = motion(500, 1e-2)
    against, on, slip = _core.strap_torque(parameters(), q_e, v_e, q_k, v_k, period=1e-2)
    np.testing.assert_array_equal(against, 20.0 * (q_k - q_e) + 0.5 * (v_k - v_e))
    np.testing.assert_array_equal(on, against)
    assert not slip.any()


@pytest.mark.parametrize("options", [*OPTIONS.values(), EVERYTHING], ids=[*OPTIONS, "everything"])
@pytest.mark.parametrize("seed", range(3))
def test_a_closed_motion_costs_work(options, seed):
    """Every motion that comes back, over its second turn: what robot and limb put in is at least nothing, and with
    neither damping nor memory it is nothing."""
    period, n = 2e-4, 40_000
    rng, turn = np.random.default_rng(seed), 2 * np.pi * np.arange(n) / (n // 2)
    q = [sum(size / k * np.sin(k * turn + rng.uniform(0, 6.3)) for k in (1, 2, 3, 5)) for size in (0.4, 0.3)]
    q_e, q_k = q[0], q[0] + q[1]
    v_e, v_k = (np.gradient(x, period) for x in (q_e, q_k))

    def work(p):
        against, on, _ = _core.strap_torque(p, q_e, v_e, q_k, v_k, period=period)
        power = against * v_k - on * v_e
        return np.sum(power[n // 2 :]) * period, np.sum(np.abs(power[n // 2 :])) * period

    cost, moved = work(parameters(**options))
    assert cost > 1e-3 * moved
    elastic = {name: value for name, value in options.items() if "relax" not in name and "mobility" not in name}
    cost, moved = work(parameters(**elastic, strap_damping=0.0))
    assert abs(cost) < 1e-4 * moved


def test_a_strap_with_slack_that_relaxes_never_pushes():
    moved = motion(20_000, 1e-3, seed=4)
    p = parameters(strap_slack=0.06, strap_relaxing_stiffness=40.0, strap_relaxation_time=0.5)
    against = _core.strap_torque(p, *moved, period=1e-3)[0]
    apart = moved[2] - moved[0]
    assert np.all(against * apart >= 0)
    assert np.count_nonzero(against == 0) > 1000


def test_it_relaxes_to_its_lasting_stiffness():
    n = 8000
    apart = np.where(np.arange(n) < 10, 0.0, 0.1)
    p = parameters(strap_damping=0.0, strap_relaxing_stiffness=12.0, strap_relaxation_time=1.0)
    against = _core.strap_torque(p, np.zeros(n), np.zeros(n), apart, np.zeros(n), period=1e-3)[0]
    assert against[10] == pytest.approx(0.1 * 32.0)
    assert against[10 + 1000] == pytest.approx(0.1 * (20.0 + 12.0 * np.exp(-1.0)), rel=1e-3)
    assert against[-1] == pytest.approx(0.1 * 20.0, rel=1e-3)


def test_tangents_and_levers_are_what_their_names_say():
    e = np.array([-1e-6, 1e-6, 0.15 - 1e-6, 0.15 + 1e-6])
    zero = np.zeros(4)
    tau = _core.strap_torque(parameters(strap_hardening=0.15), zero, zero, e, zero, period=1.0)[0]
    tangent = np.diff(tau)[::2] / 2e-6
    np.testing.assert_allclose(tangent, [20.0, 40.0], rtol=1e-4)
    # The limb's axis halfway to the cuff: half a lever, so the limb turns by more and the robot feels more.
    p = parameters(strap_along=0.25)
    against, on, _ = _core.strap_torque(p, [0.0, 0.1], [0.0, 0.0], [0.1, 0.1], [0.0, 0.0], period=1.0)
    assert on[0] == pytest.approx(1.25 * against[0])
    assert against[1] == pytest.approx(-20.0 * 0.25 * np.sin(0.1))


def test_the_offset_is_geometry_to_first_order():
    """A limb about (across, along) that goes through a cuff at lever 1 about the origin."""
    q = np.linspace(-1.0, 1.5, 50)
    for across, along in ((0.06, 0.0), (0.0, 0.06), (-0.05, 0.04)):
        true = np.arctan2(np.sin(q) - across, np.cos(q) - along)
        zero = np.zeros(50)
        p = parameters(strap_across=across, strap_along=along, strap_damping=0.0)
        tau = _core.strap_torque(p, q, zero, true - np.arctan2(-across, 1 - along), zero, period=1.0)[0]
        second = across**2 + along**2
        assert np.max(np.abs(tau / 20.0)) < 1.5 * second
        assert np.ptp(true - q) > 5 * second


@pytest.mark.parametrize("options", [*OPTIONS.values(), EVERYTHING], ids=[*OPTIONS, "everything"])
def test_jacobian_is_that_of_differences(options):
    p, moved = parameters(**options), motion(400, 1e-2)
    on = np.flatnonzero(p)
    torque, jacobian = _core.strap_torque_jacobian(p, *moved, period=1e-2, active=on)
    np.testing.assert_array_equal(torque, _core.strap_torque(p, *moved, period=1e-2)[0])
    for i, column in zip(on, jacobian.T, strict=True):
        step = np.zeros(len(p))
        step[i] = 1e-6 * p[i]
        ends = [_core.strap_torque(p + sign * step, *moved, period=1e-2)[0] for sign in (1, -1)]
        wanted = (ends[0] - ends[1]) / (2 * step[i])
        # A flank that one of the two leaves a sample earlier is no derivative.
        off = np.abs(column - wanted) > 1e-4 * max(np.max(np.abs(column)), 1e-3)
        assert np.count_nonzero(off) <= (4 if "strap_slack" in options else 0), NAMES[i]


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e308, 0.0])
def test_whatever_comes_in_it_ends(value):
    moved = motion(50, 1e-2)
    for i in range(len(NAMES)):
        p = parameters(**EVERYTHING)
        p[i] = value
        assert len(_core.strap_torque(p, *moved, period=1e-2)[0]) == 50
    for i in range(4):
        spoilt = [x.copy() for x in moved]
        spoilt[i][20] = value
        assert len(_core.strap_torque(parameters(**EVERYTHING), *spoilt, period=1e-2)[0]) == 50


def test_misuse():
    with pytest.raises(ValueError, match=r"parameters: got shape \(3,\), expected \(11,\)"):
        _core.strap_torque([1, 2, 3], [0], [0], [0], [0], period=1.0)
    with pytest.raises(ValueError, match="limb_position"):
        _core.strap_torque(parameters(), [0], [0], [0, 1], [0], period=1.0)
    with pytest.raises(ValueError, match="period"):
        _core.strap_torque(parameters(), [0], [0], [0], [0], period=0.0)
