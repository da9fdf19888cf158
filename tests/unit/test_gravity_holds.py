"""Gravity from holds: found where it is, friction told from it, and what the thesis's line and cosine make of it."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.models.estimates import Parameter
from pellucid.numerics.gravity_holds import (
    Hold,
    accuracy,
    added_gravity,
    cosine_moment,
    find_holds,
    fit_gravity,
    line_of_best_fit,
)

THESIS = np.radians([0.0, 15.0, 30.0, 45.0, 60.0, 90.0])
MGL = 1.524


def holds(angles, torque, approach=1, recording="gravity"):
    return [
        Hold(recording, 5.0 * i, 5.0 * i + 4.0, float(q), float(tau), 0.01, a)
        for i, (q, tau, a) in enumerate(zip(angles, torque, np.broadcast_to(approach, len(angles)), strict=True))
    ]


def staircase(angles, *, fs=500.0, friction=0.0, noise=0.0, seed=0, mgl=MGL, zero=0.0):
    """A joint led from angle to angle in 1 s and held for 4 s, with friction against the last motion."""
    rng = np.random.default_rng(seed)
    position, torque, last = [], [], 1.0
    previous = angles[0]
    for angle in angles:
        share = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, int(fs), endpoint=False))
        led = np.concatenate([previous + (angle - previous) * share, np.full(int(4 * fs), angle)])
        last = np.sign(angle - previous) or last
        position.append(led)
        torque.append(mgl * np.sin(led - zero) + friction * last)
        previous = angle
    q, tau = np.concatenate(position), np.concatenate(torque)
    return np.arange(len(q)) / fs, q, tau + noise * rng.standard_normal(len(q))


def test_holds_are_found_with_their_angles_and_approaches():
    angles = np.concatenate([THESIS, THESIS[-2::-1]])
    found = find_holds(*staircase(angles, friction=0.1))
    assert [h.angle for h in found] == pytest.approx(list(angles), abs=2e-3)
    assert [h.approach for h in found] == [0, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1]
    assert all(2.5 < h.end - h.start <= 5.0 for h in found)


def test_gravity_is_exact_without_noise_whatever_friction_does():
    up = fit_gravity(find_holds(*staircase(THESIS, friction=0.0)))
    assert up.gravity.value == pytest.approx(MGL, rel=1e-4)
    both = fit_gravity(find_holds(*staircase(np.concatenate([THESIS, THESIS[-2::-1]]), friction=0.2))[1:])
    assert both.gravity.value == pytest.approx(MGL, rel=1e-4)
    assert both.friction.value == pytest.approx(0.2, rel=1e-3)
    one_side = fit_gravity(find_holds(*staircase(THESIS, friction=0.2)))
    assert one_side.gravity.value == pytest.approx(MGL, rel=1e-4)
    assert one_side.offset.value == pytest.approx(0.2, rel=1e-3)


def test_an_encoder_that_is_not_zero_when_hanging_is_noticed():
    angles = np.concatenate([THESIS, THESIS[-2::-1]])
    found = fit_gravity(find_holds(*staircase(angles, zero=0.06)))
    assert found.zero.value == pytest.approx(0.06, abs=1e-3)
    assert found.gravity.value == pytest.approx(MGL, rel=1e-3)


def test_a_zero_from_elsewhere_is_used_and_its_error_carried_on():
    angles = np.concatenate([THESIS, THESIS[-2::-1]])
    rested = find_holds(*staircase(angles, zero=0.06, noise=0.01))
    sure = fit_gravity(rested, zero=Parameter("zero", "rad", 0.06, 1e-5))
    vague = fit_gravity(rested, zero=Parameter("zero", "rad", 0.06, 0.02))
    assert sure.gravity.value == pytest.approx(MGL, rel=1e-3)
    assert vague.gravity.standard_error > 3.0 * sure.gravity.standard_error
    assert sure.torque(np.array([0.06])) == pytest.approx(sure.offset.value)


def test_a_cosine_and_a_line_are_not_gravity():
    """Over the thesis's angles, tau = m g l sin q: a cosine gives 0.47 of it, a line's slope 0.65, 0.74 through 0."""
    torque = MGL * np.sin(THESIS)
    assert cosine_moment(THESIS, torque) / MGL == pytest.approx(0.47, abs=0.01)
    line = line_of_best_fit(THESIS, torque)
    assert line.slope / MGL == pytest.approx(0.648, abs=2e-3)
    assert line.through_origin / MGL == pytest.approx(0.743, abs=2e-3)
    assert line.largest_residual / MGL == pytest.approx(0.12, abs=5e-3)


def test_signs_of_equation_2_6_contradict_2_3():
    """Statics of both bodies add: with the minus signs of 2.6 the shank would come out lifting itself."""
    orthosis, shank = MGL * np.sin(THESIS), 8.225 * np.sin(THESIS)
    alone = fit_gravity(holds(THESIS, orthosis))
    assert added_gravity([holds(THESIS, orthosis + shank)], alone)[0].value == pytest.approx(8.225, rel=1e-9)
    printed = fit_gravity(holds(THESIS, -(orthosis + shank)))
    assert printed.phasor[0] + alone.phasor[0] < 0.0


def test_accuracy_is_relative_to_what_was_found():
    """The thesis's 96.21, 94.56 and 89.88 % divide by the experimental value, not by the theoretical one."""
    assert accuracy(1.584, 1.524) == pytest.approx((96.21, 96.06), abs=0.005)
    assert accuracy(0.0484, 0.0435) == pytest.approx((89.88, 88.74), abs=0.005)
    subjects = [(8.244, 8.225), (14.87, 13.56), (9.355, 8.674)]
    means = np.mean([accuracy(*s) for s in subjects], axis=0)
    assert means == pytest.approx((94.56, 94.09), abs=0.02)


def test_intervals_hold_for_few_holds():
    """Six holds leave four degrees of freedom: intervals as of a normal distribution would be far too narrow."""
    rng = np.random.default_rng(4)
    inside = 0
    for _ in range(300):
        torque = MGL * np.sin(THESIS) + 0.3 + 0.03 * rng.standard_normal(len(THESIS))
        low, high = fit_gravity(holds(THESIS, torque)).gravity.interval()
        inside += low <= MGL <= high
    assert 0.90 <= inside / 300 <= 0.99


def test_trials_that_differ_widen_the_interval():
    rng = np.random.default_rng(8)
    alone = fit_gravity(holds(THESIS, MGL * np.sin(THESIS) + 0.005 * rng.standard_normal(6)))
    noise = 0.005 * rng.standard_normal((3, 6))
    trials = [
        holds(THESIS, MGL * np.sin(THESIS) + m * np.sin(THESIS - 0.05) + e)
        for m, e in zip((8.0, 8.2, 8.4), noise, strict=True)
    ]
    gravity, zero = added_gravity(trials, alone)
    assert zero.value == pytest.approx(0.05, abs=2e-3)
    same, _ = added_gravity([trials[1]], alone)
    assert gravity.value == pytest.approx(8.2, abs=0.03)
    assert gravity.standard_error > 4.0 * same.standard_error


def test_a_recording_that_never_rests_and_one_angle_only_are_refused():
    time = np.arange(5000) / 500.0
    moving = np.sin(2.0 * np.pi * 0.5 * time)
    with pytest.raises(IdentificationError, match="swing: found no 1 s in which the joint is held still"):
        find_holds(time, moving, moving, recording="swing")
    with pytest.raises(IdentificationError, match=r"gravity: the segment is held at 1 angle\(s\), expected 3"):
        fit_gravity(holds([0.5, 0.501], [0.7, 0.7]))
