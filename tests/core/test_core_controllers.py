"""The core's controllers from Python: against plain NumPy, in nonsense, in float, and against closed forms."""

import numpy as np
import pytest
from residual_reference import Reference
from scipy.signal import butter, sosfilt

from pellucid import _core

PERIOD = 0.002
VALUES = dict(
    orthosis_inertia=0.048, orthosis_viscous=0.008, orthosis_gravity=1.56, coulomb=0.02, friction_width=0.05,
    limb_inertia=0.33, limb_viscous=0.2, limb_gravity=8.2, strap_stiffness=14.0, strap_damping=0.4, slack=0.02,
    correct_position=0.41, correct_velocity=52.0, correct_mismatch=4.5, correct_mismatch_rate=144.0,
    correct_disturbance=1367.0, innovation_limit=0.05, gravity_share=0.8, viscous_share=0.8, friction_share=0.5,
    assist_width=0.6, inertia_share=0.7, actuator_inertia=0.055, actuator_viscous=0.1, actuator_coulomb=2.6,
    actuator_leak=1.7, torque_gain=0.3, proportional=1.0, integral=0.5, derivative=0.01, integral_limit=1.0,
    preview=0.01, emg_limit=40.0, trust_time=0.3, swing_angle=0.5, swing_rate=4.4, effort_limit=1e3, rate_limit=1e9,
    velocity_limit=15.0, position_min=-9.0, position_max=9.0, stop_margin=0.1, max_age=0.01, max_repeats=2,
    period=PERIOD,
) | {f"phase_gain_{i}": 1 + 0.03 * i for i in range(8)}  # fmt: skip


NAMES = [field["name"] for law in _core.laws() if law["name"] == "worn" for field in law["fields"]]


def worn(*, single=False, **changes):
    values = VALUES | changes
    return _core.law("worn", [values[name] for name in NAMES], single)


def swing(n, rng):
    t = PERIOD * np.arange(n)
    phase = 2 * np.pi * 0.8 * t
    position = 0.5 + 0.45 * np.sin(phase) + 0.1 * np.sin(2.3 * phase)
    torque = 1.5 * np.cos(phase) + 0.1 * rng.standard_normal(n)
    emg = 6 * np.sin(phase + 0.3) + rng.standard_normal(n)
    return t, np.round(position / 1e-4) * 1e-4, torque, emg


def test_the_names_are_all_there():
    assert set(VALUES) == set(NAMES)


def test_it_is_what_plain_numpy_makes_of_the_theory(rng):
    t, position, torque, emg = swing(4000, rng)
    emg[1500:2200] = np.nan
    got = worn().run(t, position, torque, emg)
    reference = Reference(**VALUES)
    wanted = [reference.step(*now) for now in zip(position, torque, emg, strict=True)]
    assert np.abs(got).max() > 2
    np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)


def test_float_stays_near_double(rng):
    signals = swing(20_000, rng)
    double = worn().run(*signals)
    single = worn(single=True).run(*signals)
    assert np.abs(double - single).max() < 2e-3 * np.abs(double).max()


@pytest.mark.parametrize("single", [False, True])
def test_two_hundred_thousand_periods_of_nonsense(single, rng):
    n, limit, rate = 200_000, 8.0, 250.0
    time, position, torque, emg = swing(n, rng)
    nonsense = np.array([np.nan, np.inf, -np.inf, 5e-324, 1e308, -1e308, 1e20, 0.0, 3.0])
    for column, share in ((time, 2e-4), (position, 1e-3), (torque, 1e-3), (emg, 1e-2)):
        where = rng.random(n) < share
        column[where] = rng.choice(nonsense, where.sum())
    changes = dict(effort_limit=limit, rate_limit=rate, position_min=-0.3, position_max=1.3)
    controller = worn(single=single, **changes)
    unsafe, shut, moving, before = 0, 0, 0, 0.0
    chances = rng.random(n)
    for t, q, u, e, chance in zip(*(c.tolist() for c in (time, position, torque, emg, chances)), strict=True):
        out = controller.step(t, q, u, e)
        ok = -limit <= out <= limit
        if abs(out) > abs(before):
            ok = ok and abs(out - before) <= rate * PERIOD * 1.0001
        unsafe += not ok
        moving += out != 0
        if controller.fault != "none":
            shut += 1
            if chance < 0.1:
                controller.reset()
        before = out
    assert unsafe == 0
    assert shut > 1000
    assert moving > n / 3


def test_a_jump_of_the_encoder_shuts_the_gate(rng):
    t, position, torque, emg = swing(1000, rng)
    position[600:] += 0.2
    controller = worn(rate_limit=300.0)
    command = controller.run(t, position, torque, emg)
    assert controller.fault == "velocity"
    assert command[599] != 0
    assert np.all(command[700:] == 0)


def test_emg_that_is_lost_fades_out_without_a_step(rng):
    t, position, torque, emg = swing(3000, rng)
    torque = 1.5 * np.cos(2 * np.pi * 0.8 * t)
    emg[1500:] = np.nan
    controller = worn(max_age=1.0)
    command = controller.run(t, position, torque, emg)
    assert controller.fault == "none"
    assert controller.estimates["trust"] == 0.0
    assert np.abs(command[-500:]).max() > 0.5  # what needs no EMG goes on
    assert np.abs(np.diff(command[1700:])).max() < 0.2


def test_what_makes_no_sense_gives_nothing():
    for change in ({"limb_inertia": 0.0}, {"period": np.nan}, {"strap_stiffness": 1e6}, {"proportional": np.inf}):
        controller = worn(**change)
        assert controller.fault == "configuration"
        assert controller.step(0.0, 1.0, 1.0, 1.0) == 0.0
    with pytest.raises(ValueError, match=r"expected \(53,\)"):
        _core.law("worn", [1.0, 2.0])


def test_emg_chain_is_scipys(rng):
    fs, n = 2048.0, 4096
    band, envelope = butter(2, [30, 450], "bandpass", fs=fs, output="sos"), butter(2, 4, fs=fs, output="sos")
    raw = 1e-4 * rng.standard_normal((n, 2))
    weights = np.array([[0.3, -0.1, 0.0], [-1e5, 2e4, 5e3], [8e4, 1e4, -3e3]])
    chain = _core.EmgTorque(
        band=band, envelope=envelope, weights=weights, floor=[0, 0], ceiling=[1, 1], patience=10, torque_limit=50.0
    )
    for start in range(0, n, 4):
        chain.listen(raw[start : start + 4])
    chain.listen([])
    levels = sosfilt(envelope, np.abs(sosfilt(band, raw, axis=0)), axis=0)[-1]
    np.testing.assert_allclose(chain.levels, levels, rtol=1e-12)
    q = 0.7
    wanted = (weights @ q ** np.arange(3)) @ np.concatenate([[1.0], levels])
    assert chain.torque(q) == pytest.approx(wanted, rel=1e-12)
    assert chain.valid
    chain.listen(np.full((20, 2), np.nan))
    assert not chain.valid
    assert np.isfinite(chain.torque(q))


def test_the_strap_is_found_where_everything_else_is_known():
    """Two bodies driven by a known torque: k, started 50 % off, comes back; b, which a lag disguises, comes nearer."""
    truth = VALUES | {"slack": 0.0, "coulomb": 0.0, "strap_stiffness": 12.0, "strap_damping": 0.5}
    start = truth | {
        "strap_stiffness": 18.0, "strap_damping": 0.3, "bandwidth": 300.0, "slowest": 0.5, "forgetting": 20.0,
        "prior_mismatch": 1e-3, "excitation": 1e-3, "stiffness_min": 4.0, "stiffness_max": 30.0, "damping_min": 0.05,
        "damping_max": 2.0,
    }  # fmt: skip
    made = _core.StrapEstimator([start[name] for name in _core.STRAP_ESTIMATOR_PARAMETER_NAMES])
    h, q, v, p, w = PERIOD / 10, 0.0, 0.0, 0.0, 0.0
    for k in range(30_000):
        t = k * PERIOD
        spring, muscle = 0.6 * np.sin(9.1 * t), 0.6 * np.sin(3.1 * t) + 2.0 * np.sin(13 * t)
        found = made.step(q, spring, muscle)
        for _ in range(10):
            strap = 12.0 * (p - q) + 0.5 * (w - v)
            v += h * (spring + strap - 0.008 * v - 1.56 * np.sin(q)) / 0.048
            w += h * (muscle - strap - 0.2 * w - 8.2 * np.sin(p)) / 0.33
            q, p = q + h * v, p + h * w
    assert found[2]
    assert found[0] == pytest.approx(12.0, rel=0.1)
    assert abs(found[1] - 0.5) < abs(0.3 - 0.5)
