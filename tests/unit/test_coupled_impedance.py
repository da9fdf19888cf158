"""The strap between two bodies: found from either one's balance, lost in their sum, with intervals that hold."""

from dataclasses import replace

import numpy as np
import pytest
from two_bodies import Pair, record, swing

from pellucid._errors import IdentificationError
from pellucid.models.estimates import Parameter
from pellucid.orthosis.strap.coupled_impedance import (
    PublishedCoupling,
    align,
    decay_time,
    fit_coupling,
    fit_two_poles,
    mismatch,
    published_mismatch,
    seen_mismatch,
    solve_balance,
    torque_mismatch,
)
from pellucid.orthosis.strap.strap_model import Orthosis, from_limb, from_orthosis
from pellucid.orthosis.transfer.fit_transfer_function import fit_percent

PAIR = Pair()


@pytest.fixture(scope="module")
def truths():
    return swing(PAIR, seconds=16.0, count=8, substeps=2)


def sides(truth):
    """Right-hand side of equation 2.2, and the orthosis's own balance, both from the simulator's own accelerations."""
    o, m = PAIR.orthosis, PAIR.limb
    orthosis = o.inertia * truth.position_rates[:, 1] + o.gravity * np.sin(truth.position) - truth.torque
    limb = m.inertia * truth.limb_rates[:, 1] + m.gravity * np.sin(truth.limb) - truth.knee_torque
    return -limb - orthosis, orthosis + o.viscous * truth.position_rates[:, 0]


def test_equation_2_2_holds_nothing_of_the_strap(truths):
    """What is left of its right-hand side is both bodies' own damping, to the last bits; no strap is in it."""
    for truth in truths[:2]:
        left, _ = sides(truth)
        own = PAIR.limb.viscous * truth.limb_rates[:, 0] + PAIR.orthosis.viscous * truth.position_rates[:, 0]
        assert np.abs(left - own).max() < 1e-12
        assert np.abs(truth.mismatch).max() > np.radians(5.0)  # and yet the strap works hard


def test_least_squares_of_2_2_finds_no_strap_and_one_body_s_balance_does(truths):
    truth = truths[0]
    columns = np.column_stack([truth.limb_rates - truth.position_rates, truth.mismatch])[:, [1, 0, 2]]
    together, alone = sides(truth)
    literal = np.linalg.lstsq(columns, together, rcond=None)[0]
    assert abs(literal[1] / PAIR.damping - 1.0) > 0.5
    assert abs(literal[2] / PAIR.stiffness - 1.0) > 0.5
    exact = np.linalg.lstsq(columns, alone, rcond=None)[0]
    assert exact == pytest.approx([0.0, PAIR.damping, PAIR.stiffness], abs=1e-9)


def test_both_balances_give_the_same_torque_with_opposite_signs(truths):
    truth = truths[0]
    clean = record(truth, np.random.default_rng(0), noise=0.0, torque_noise=0.0, encoder=0.0)
    strap = PAIR.stiffness * truth.mismatch + PAIR.damping * (truth.limb_rates - truth.position_rates)[:, 0]
    inner = slice(500, -500)
    for found in (from_orthosis(clean, PAIR.orthosis), from_limb(clean, PAIR.limb, truth.limb)):
        assert fit_percent(strap[inner], found.torque[inner]) > 99.0


def test_derivatives_of_the_strap_s_torque_are_those_of_differences(truths):
    seen = record(truths[0], np.random.default_rng(0))
    made = from_orthosis(seen, PAIR.orthosis)
    for index, name in enumerate(("inertia", "viscous", "gravity", "coulomb")):
        moved = replace(PAIR.orthosis, **{name: getattr(PAIR.orthosis, name) + 0.01})
        assert (from_orthosis(seen, moved).torque - made.torque) / 0.01 == pytest.approx(made.sensitivity[:, index])


def test_response_of_a_strap_is_that_of_a_differential_equation(truths):
    """The transform's bounded answer against the simulator's own mismatch."""
    truth = truths[1]
    strap = PAIR.stiffness * truth.mismatch + PAIR.damping * (truth.limb_rates - truth.position_rates)[:, 0]
    found = mismatch(strap, 500.0, stiffness=PAIR.stiffness, damping=PAIR.damping)
    assert np.abs(found - truth.mismatch)[500:-500].max() < 1e-4


def test_everything_is_found_without_noise_whatever_the_clock_and_the_mounting(truths):
    clean = [
        record(t, np.random.default_rng(0), noise=0.0, torque_noise=0.0, encoder=0.0, shift=d, offset=o, gain=1.03)
        for t, d, o in zip(truths[:2], (0.31, -0.17), (0.2, -0.4), strict=True)
    ]
    fit = fit_coupling(clean, [from_orthosis(s, PAIR.orthosis) for s in clean])
    assert fit.converged
    assert fit.stiffness.value == pytest.approx(PAIR.stiffness, rel=2e-3)
    assert fit.damping.value == pytest.approx(PAIR.damping, rel=5e-3)
    assert fit.inertia.value == pytest.approx(0.0, abs=1e-3)
    assert fit.gain.value == pytest.approx(1.03, abs=1e-3)
    assert [i.shift for i in fit.instruments] == pytest.approx([0.31, -0.17], abs=1e-3)
    assert [i.offset for i in fit.instruments] == pytest.approx([0.2, -0.4], abs=1e-3)


def test_a_late_clock_would_look_like_damping(truths):
    """With the clock held 40 ms wrong the damping is nonsense: why the shift is estimated with the strap."""
    seen = [record(t, np.random.default_rng(1), shift=0.0) for t in truths[:2]]
    torques = [from_orthosis(s, PAIR.orthosis) for s in seen]
    late = np.concatenate([s.imu_angle - np.interp(s.imu_time - 0.04, s.time, s.position) for s in seen])
    columns = [_static(s, t.torque) for s, t in zip(seen, torques, strict=True)]
    # Static approximation: D = tau/k - b/k^2 dtau/dt.
    _, compliance, lag = np.linalg.lstsq(np.vstack(columns), late, rcond=None)[0]
    assert abs(-lag / compliance**2 / PAIR.damping - 1.0) > 0.5
    assert fit_coupling(seen, torques).damping.value == pytest.approx(PAIR.damping, rel=0.3)


def _static(swing, torque):
    slope = np.gradient(torque, 1.0 / swing.fs)
    sampled = [np.interp(swing.imu_time, swing.time, x) for x in (torque, slope)]
    return np.column_stack([np.ones(len(swing.imu_time)), *sampled])


def test_intervals_of_stiffness_and_damping_hold_the_truth(truths):
    """40 draws of the IMU's coloured error and of an orthosis known to a few per cent: nine in ten at least."""
    o = PAIR.orthosis
    spread = np.diag([0.02 * o.inertia, 0.2 * o.viscous, 0.01 * o.gravity, 0.01])
    draws, inside = 40, np.zeros(3, int)
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        drawn = np.array([o.inertia, o.viscous, o.gravity, 0.0]) + spread @ rng.standard_normal(4)
        known = Orthosis(*drawn[:3], 0.0, spread**2)
        seen = [record(t, rng, shift=0.08) for t in (truths[seed % 8], truths[(seed + 1) % 8])]
        fit = fit_coupling(seen, [from_orthosis(s, known) for s in seen])
        for place, (parameter, true) in enumerate(
            ((fit.stiffness, PAIR.stiffness), (fit.damping, PAIR.damping), (fit.inertia, 0.0))
        ):
            low, high = parameter.interval()
            inside[place] += low <= true <= high
        # An interval that holds everything would be easy.
        assert fit.stiffness.relative_sd < 15.0
        assert fit.damping.relative_sd < 30.0
    assert np.all(inside >= 0.9 * draws), inside


def test_an_orthosis_that_is_hardly_known_widens_the_intervals(truths):
    seen = [record(t, np.random.default_rng(2)) for t in truths[:2]]
    vague = replace(PAIR.orthosis, covariance=np.diag([0.01, 0.05, 0.4, 0.05]) ** 2)
    sure = fit_coupling(seen, [from_orthosis(s, PAIR.orthosis) for s in seen])
    wide = fit_coupling(seen, [from_orthosis(s, vague) for s in seen])
    assert wide.stiffness.value == sure.stiffness.value
    assert wide.stiffness.standard_error > 1.5 * sure.stiffness.standard_error


def test_a_calibrated_gain_narrows_the_stiffness(truths):
    seen = [record(t, np.random.default_rng(3)) for t in truths[:2]]
    torques = [from_orthosis(s, PAIR.orthosis) for s in seen]
    free = fit_coupling(seen, torques)
    held = fit_coupling(seen, torques, gain=Parameter("gain", "1", 1.0, 1e-4))
    assert held.gain.value == pytest.approx(1.0, abs=5e-4)
    assert held.gain.standard_error < 2e-4 < free.gain.standard_error
    assert held.stiffness.standard_error < free.stiffness.standard_error


def test_a_swing_that_was_not_fitted_gets_its_own_clock_and_mounting(truths):
    seen = [record(t, np.random.default_rng(4)) for t in truths[:2]]
    fit = fit_coupling(seen, [from_orthosis(s, PAIR.orthosis) for s in seen])
    other = record(truths[2], np.random.default_rng(5), shift=-0.6, offset=0.5)
    found = align(other, from_orthosis(other, PAIR.orthosis), fit)
    assert found.shift == pytest.approx(-0.6, abs=5e-3)
    assert found.offset == pytest.approx(0.5, abs=0.01)
    time, angle = seen_mismatch(other, found)
    known = np.isfinite(angle)
    assert np.std(angle[known] - np.interp(time[known], truths[2].time, truths[2].mismatch)) < 0.02


def test_where_the_orthosis_sticks_the_torque_is_not_known_and_left_out(truths):
    """Dry friction passes from one side to the other at a reversal, somehow: those samples do not count."""
    seen = [record(t, np.random.default_rng(6)) for t in truths[:2]]
    smooth = fit_coupling(seen, [from_orthosis(s, PAIR.orthosis) for s in seen])
    dry = [from_orthosis(s, replace(PAIR.orthosis, coulomb=0.2)) for s in seen]
    assert all(t.known.all() for t in (from_orthosis(s, replace(PAIR.orthosis, coulomb=1e-3)) for s in seen))
    sticking = fit_coupling(seen, dry)
    assert sticking.used < smooth.used
    assert sum(np.isnan(r).sum() for r in sticking.residuals) > sum(np.isnan(r).sum() for r in smooth.residuals)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"imu_time": lambda s: s.imu_time + 100.0}, "swing: the IMU's times and the actuator's do not overlap"),
        ({"imu_angle": lambda s: np.full(len(s.imu_angle), np.nan)}, "swing: found 0 samples of the IMU"),
        ({"position": lambda s: np.zeros(len(s.position))}, "swing: found .* samples of the IMU and 0.0 deg"),
    ],
)
def test_recordings_that_cannot_tell_are_refused(truths, change, said):
    good = record(truths[0], np.random.default_rng(0))
    bad = replace(good, **{name: make(good) for name, make in change.items()})
    with pytest.raises(IdentificationError, match=said):
        fit_coupling([bad], [from_orthosis(bad, PAIR.orthosis)])


# --- as published ---------------------------------------------------------------------------------------------------


def test_the_thesis_s_transfer_function_fits_a_little_and_finds_another_strap(truths):
    truth = truths[0]
    seen = record(truth, np.random.default_rng(0))
    torque = torque_mismatch(seen, truth.limb, PAIR.orthosis, PAIR.limb)
    found = fit_two_poles([torque], [truth.mismatch], 500.0)
    assert fit_percent(truth.mismatch, published_mismatch(found, torque, truth.mismatch, 500.0)) < 90.0
    assert abs(found.stiffness / PAIR.stiffness - 1.0) > 0.5
    balance = solve_balance([torque], [truth.mismatch], 500.0)
    assert abs(balance.stiffness / PAIR.stiffness - 1.0) > 0.5


def test_two_poles_are_found_where_there_are_two_poles():
    time = np.arange(5000) / 500.0
    torque = np.sin(2 * np.pi * 0.7 * time) + 0.5 * np.sin(2 * np.pi * 1.9 * time)
    true = PublishedCoupling(0.06, 0.8, 4.1)
    start = np.exp(-5.0 * time)  # some free response
    angle = published_mismatch(true, torque, 0.1 * start, 500.0)
    found = fit_two_poles([torque], [angle], 500.0)
    assert (found.inertia, found.damping, found.stiffness) == pytest.approx((0.06, 0.8, 4.1), rel=1e-2)
    assert found.at_bound == ()


def test_printed_subjects_swing_and_are_no_straps():
    """Table 3.5: two of three have the frequency of the swinging leg, one an inertia above the shank's own."""
    printed = [
        PublishedCoupling(0.0609, 0.7870, 4.1411),
        PublishedCoupling(0.7536, 2.7569e-9, 20.9489),
        PublishedCoupling(0.1540, 0.2187, 3.5228),
    ]
    assert [c.natural_frequency for c in printed[1:]] == pytest.approx([0.839, 0.761], abs=1e-3)
    assert [c.at_bound for c in printed] == [(), ("damping",), ()]
    assert printed[1].damping_ratio == pytest.approx(3.5e-10, rel=0.02)
    assert printed[1].inertia > 0.6779  # the whole shank's, by Winter
    assert np.mean([57.8, 61.94, 30.15]) == pytest.approx(49.963, abs=1e-3)  # printed 49.92
    assert np.mean([0.1297, 0.0338, 0.06134]) == pytest.approx(0.075, abs=1e-3)
    # fit = 100 (1 - rmse/sd): the standard deviation of each subject's mismatch.
    sd = np.array([0.1297, 0.0338, 0.06134]) / (1.0 - np.array([57.8, 61.94, 30.15]) / 100.0)
    assert sd == pytest.approx([0.307, 0.089, 0.088], abs=1e-3)


def test_friction_that_looks_like_damping_leaves_something_to_fit():
    assert decay_time(20.0, 0.6) == pytest.approx(0.09)
    # A spring and a damper of 11.6 N*m/rad and 8.1 N*m*s/rad, as a strap that rubs was fitted, forget within 2 s.
    assert decay_time(11.6, 8.1) == 0.3
