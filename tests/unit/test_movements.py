"""Movements in an angle record: known ones are found where they are, and what is none is left out with a reason."""

from pathlib import Path

import numpy as np
import pytest
from made_pointing import minimum_jerk

import pellucid as pl
from pellucid import _core
from pellucid._errors import RecordingError
from pellucid.numerics.motion import moving_samples, tangential_speed
from pellucid.people.movements import (
    MOVEMENT_DEFINITIONS,
    MovementRule,
    kinematics,
    movements,
    rest_stretches,
    ringing_share,
    target_stretches,
)

FS = 200.0
RAW = MovementRule(lowpass=20.0)


def record(parts, seconds=8.0, fs=FS):
    time = np.arange(int(seconds * fs)) / fs
    angle = sum((height * minimum_jerk((time - start) / duration) for start, duration, height in parts), 0.0 * time)
    return time, angle


def steps(time, *at):
    target = np.zeros(len(time))
    for start, height in at:
        target[time >= start] += height
    return target_stretches(time, target)


def test_a_minimum_jerk_movement_is_measured_as_it_is():
    """Between 5 % of its peak, 0.882 of its time; peak 1.875 A/T, mean as it covers almost all of A there."""
    time, angle = record([(1.0, 0.8, 0.6), (4.0, 1.2, -0.9)])
    motion = kinematics(time, angle, RAW)
    (up, down), none = movements(motion, steps(time, (0.9, 0.6), (3.8, -0.9)), RAW)
    assert none == []
    s = np.linspace(0.0, 1.0, 200_001)
    inside = s[30.0 * s**2 * (1.0 - s) ** 2 > 0.05 * 1.875]
    share = inside[-1] - inside[0]
    for found, duration, amplitude in ((up, 0.8, 0.6), (down, 1.2, 0.9)):
        assert found.amplitude == pytest.approx(amplitude)
        assert found.duration == pytest.approx(share * duration, abs=1.5 / FS)
        assert found.peak_velocity == pytest.approx(1.875 * amplitude / duration, rel=2e-3)
        assert found.peak_acceleration == pytest.approx(10.0 / np.sqrt(3.0) * amplitude / duration**2, rel=0.01)
        assert found.peak_time == pytest.approx(0.5, abs=0.01)
        assert found.reach == pytest.approx(amplitude, rel=1e-3)
        assert found.mean_velocity == pytest.approx(found.travel / found.duration)
    assert (up.direction, down.direction) == (1, -1)


def test_three_hertz_lengthen_and_flatten_a_fast_movement():
    """What the published filter does to 36 degrees in 0.6 s (audit A14): longer, with a lower peak acceleration."""
    time, angle = record([(1.0, 0.6, np.radians(36.0))], 4.0)
    stretches = steps(time, (0.9, np.radians(36.0)))
    found = {}
    for cutoff in (3.0, 20.0):
        rule = MovementRule(lowpass=cutoff)
        (found[cutoff],), _ = movements(kinematics(time, angle, rule), stretches, rule)
    assert found[3.0].peak_acceleration / found[20.0].peak_acceleration == pytest.approx(0.94, abs=0.03)
    assert 1.0 < found[3.0].duration / found[20.0].duration < 1.1


def test_a_correction_at_the_target_counts_as_published_and_not_with_the_other_end():
    time, angle = record([(1.0, 0.8, 0.6), (2.6, 0.4, 0.03)])
    stretches = steps(time, (0.9, 0.63))
    first_rest = MovementRule(lowpass=20.0, ends="peak")
    motion = kinematics(time, angle, RAW)
    (published,), _ = movements(motion, stretches, RAW)
    (other,), _ = movements(motion, stretches, first_rest)
    assert published.duration > 1.8
    assert other.duration < 0.8
    assert published.peak_velocity == other.peak_velocity


def test_without_a_target_rests_divide_movements():
    time, angle = record([(1.0, 0.8, 0.6), (3.0, 0.8, -0.6), (5.0, 0.6, 0.4), (7.0, 0.2, 0.01)])
    motion = kinematics(time, angle, RAW)
    stretches = rest_stretches(motion, RAW, least=0.05)
    found, none = movements(motion, stretches, RAW)
    assert none == []
    assert [m.direction for m in found] == [1, -1, 1]
    assert [m.start for m in found] == pytest.approx([1.05, 3.05, 5.04], abs=0.02)
    labelled = rest_stretches(motion, RAW, least=0.05, amplitude=0.6)
    assert [s.amplitude for s in labelled] == [0.6, None, 0.6]


def test_a_record_at_rest_has_no_movement():
    time = np.arange(400) / FS
    motion = kinematics(time, np.zeros(400), RAW)
    assert rest_stretches(motion, RAW, least=0.05) == []


def test_a_step_that_was_drawn_out_is_one_step():
    time = np.arange(0.0, 4.0, 0.005)
    target = np.interp(time, [1.0, 1.02, 3.0, 3.02], [0.0, 0.5, 0.5, 0.1])
    found = target_stretches(time, target)
    assert [s.amplitude for s in found] == pytest.approx([0.5, -0.4])
    assert found[0].end == found[1].begin


@pytest.mark.parametrize(
    ("parts", "lost", "kind"),
    [
        ([(1.0, 0.5, 0.3), (1.7, 0.5, 0.3)], None, "no_peak"),
        ([(1.0, 0.8, 0.1)], None, "still"),
        ([(1.0, 0.8, -0.6)], None, "direction"),
        ([(1.0, 0.8, 0.6)], (1.2, 1.6), "lost"),
        ([(3.4, 0.8, 0.9)], None, "unfinished"),
    ],
)
def test_what_is_no_movement_says_why(parts, lost, kind):
    time, angle = record(parts)
    if lost is not None:
        angle[(time > lost[0]) & (time < lost[1])] = np.nan
    stretches = steps(time, (0.9, 0.6), (3.9, -0.6))[:1]
    found, (none,) = movements(kinematics(time, angle, RAW), stretches, RAW)
    assert found == []
    assert none.kind == kind
    assert none.found
    assert none.expected


def test_a_short_loss_is_bridged():
    time, angle = record([(1.0, 0.8, 0.6)], 4.0)
    whole = kinematics(time, angle, RAW)
    angle[(time > 1.3) & (time < 1.38)] = np.nan
    bridged = kinematics(time, angle, RAW)
    assert not bridged.lost.any()
    assert np.max(np.abs(bridged.angle - whole.angle)) < 0.01


def test_what_cannot_be_filtered_is_refused():
    time, angle = record([(1.0, 0.8, 0.6)], 2.0)
    with pytest.raises(RecordingError, match=r"x\.csv: found a low-pass of 150 Hz"):
        kinematics(time, angle, MovementRule(lowpass=150.0), where="x.csv")
    with pytest.raises(RecordingError, match="increasing times"):
        kinematics(time[::-1], angle, RAW)
    with pytest.raises(RecordingError, match="found 0 finite samples"):
        kinematics(time, np.full(len(time), np.nan), RAW)
    stretches = steps(time, (1.97, 0.6))
    _, (none,) = movements(kinematics(time, angle, RAW), stretches, RAW)
    assert none.kind == "too_few_samples"


def ringing(time, start, height, frequency=1.6, damping=0.35):
    """A step that overshoots and rings, as a joint does in a stiff robot."""
    s = np.maximum(time - start, 0.0)
    omega = 2.0 * np.pi * frequency
    free = omega * np.sqrt(1.0 - damping**2)
    wave = np.cos(free * s) + damping * omega / free * np.sin(free * s)
    return height * (1.0 - np.exp(-damping * omega * s) * wave)


def rest_time(time, angle, rule):
    """When the speed is above the share of its largest for the last time, less the first time: by definition."""
    speed = np.abs(np.gradient(kinematics(time, angle, rule).angle, time))
    above = np.flatnonzero(speed > rule.threshold * speed.max())
    return time[above[-1]] - time[above[0]]


@pytest.mark.parametrize("height", [0.6, -0.6])
@pytest.mark.parametrize("with_target", [True, False])
def test_overshoot_and_correction_backwards_belong_to_the_movement(height, with_target):
    time = np.arange(0.0, 6.0, 1.0 / FS)
    angle = ringing(time, 1.0, height)
    motion = kinematics(time, angle, RAW)
    stretches = steps(time, (0.8, height)) if with_target else rest_stretches(motion, RAW, least=0.05)
    (found,), none = movements(motion, stretches, RAW)
    assert none == []
    assert found.duration == pytest.approx(rest_time(time, angle, RAW), abs=1.5 / FS)
    forward = np.argmax(np.diff(np.sign(height) * angle[time > 1.02]) < 0.0) / FS
    assert found.duration > 1.3 * forward  # the way forward alone is much shorter
    assert found.direction == np.sign(height)
    assert angle[found.last] == pytest.approx(height, abs=0.02)
    first_rest = MovementRule(lowpass=20.0, ends="peak")
    (other,), _ = movements(motion, stretches, first_rest)
    assert other.duration < 1.1 * forward
    # A correction backwards adds neither speed nor acceleration.
    assert (found.peak_velocity, found.peak_acceleration) == (other.peak_velocity, other.peak_acceleration)


def test_a_start_in_the_wrong_direction_belongs_to_the_movement():
    time, angle = record([(1.0, 0.4, -0.08), (1.4, 0.8, 0.68)])
    motion = kinematics(time, angle, RAW)
    for stretches in (steps(time, (0.8, 0.6)), rest_stretches(motion, RAW, least=0.05)):
        (found,), _ = movements(motion, stretches, RAW)
        assert found.start == pytest.approx(1.02, abs=0.05)
        assert found.direction == 1


def test_a_fast_correction_backwards_is_no_second_movement():
    """A rebound at nine tenths of the peak's speed: the movement is measured, and lasts until it rests."""
    time, angle = record([(1.0, 0.8, 0.9), (1.8, 0.3, -0.3)])
    (found,), none = movements(kinematics(time, angle, RAW), steps(time, (0.8, 0.6)), RAW)
    assert none == []
    assert found.duration > 0.95


def test_what_was_under_way_when_a_target_came_belongs_to_the_movement_before():
    """The way up still corrects downwards at 4 s, when a target higher up comes: the movement to it begins later."""
    time, angle = record([(3.0, 0.8, 0.8), (3.75, 0.4, -0.2), (4.5, 0.8, 0.5)])
    stretches = steps(time, (2.8, 0.6), (3.95, 0.5))
    found, none = movements(kinematics(time, angle, RAW), stretches, RAW)
    assert [(m.direction, m.start) for m in found] == [(1, pytest.approx(4.54, abs=0.02))]
    assert [n.kind for n in none] == ["unfinished"]  # its correction was not seen to its end


def test_setting_out_before_the_next_target_is_no_unfinished_correction():
    time, angle = record([(1.0, 0.8, 0.6), (2.8, 0.8, -0.6)])
    found, none = movements(kinematics(time, angle, RAW), steps(time, (0.8, 0.6), (3.0, -0.6)), RAW)
    assert none == []
    assert found[0].settled
    assert found[0].duration == pytest.approx(0.7, abs=0.02)
    assert found[0].lasted == found[0].duration


def test_back_and_forth_without_rests_is_several_movements():
    time, angle = record([(1.0, 0.8, 0.6), (1.8, 0.8, -0.6), (2.6, 0.8, 0.5)])
    motion = kinematics(time, angle, RAW)
    found, _ = movements(motion, rest_stretches(motion, RAW, least=0.05), RAW)
    assert [m.direction for m in found] == [1, -1, 1]
    assert [m.duration for m in found] == pytest.approx([0.71] * 3, abs=0.06)


def test_speed_is_the_norm_of_the_velocity():
    rng = np.random.default_rng(3)
    velocity = rng.standard_normal((50, 3))
    np.testing.assert_allclose(tangential_speed(velocity), np.sqrt((velocity**2).sum(axis=1)))
    np.testing.assert_array_equal(tangential_speed(velocity[:, 0]), np.abs(velocity[:, 0]))
    assert moving_samples(np.array([0.0, 0.04, 0.2, 1.0, 0.0, 0.3, 0.05]), 0.05) == (2, 5)


@pytest.mark.parametrize("duration", [0.2, 0.25, 0.3, 0.4, 0.5, 0.8, 1.5])
@pytest.mark.parametrize("lowpass", [3.0, 6.0])
def test_the_ringing_of_the_filter_is_no_correction(duration, lowpass):
    """A one-way movement that is short for its filter rings at up to 10 % of its peak speed, before and after it."""
    rule = MovementRule(lowpass=lowpass)
    time, angle = record([(2.0, duration, 0.5)], 5.0)
    motion = kinematics(time, angle, rule)
    (found,), _ = movements(motion, steps(time, (1.7, 0.5)), rule)
    forward = np.flatnonzero(motion.velocity > rule.threshold * motion.velocity.max())
    assert found.duration == pytest.approx((forward[-1] - forward[0]) / FS)


@pytest.mark.parametrize("duration", [0.25, 0.3])
def test_an_overshoot_of_a_fast_movement_counts_beside_the_ringing(duration):
    rule = MovementRule()
    time, angle = record([(2.0, duration, 0.6), (2.0 + 1.3 * duration, 0.5, -0.15)], 5.0)
    (found,), _ = movements(kinematics(time, angle, rule), steps(time, (1.7, 0.45)), rule)
    assert found.duration > 0.5


@pytest.mark.parametrize(("duration", "overshoot", "pause", "lowpass"), [
    (0.4, 0.06, 0.15, 3.0), (0.4, 0.1, 0.3, 3.0), (0.6, 0.1, 0.15, 3.0), (0.8, 0.18, 0.3, 3.0), (0.6, 0.18, 0.3, 10.0),
])  # fmt: skip
@pytest.mark.parametrize("has_target", [True, False])
def test_a_correction_backwards_after_a_pause_is_part_of_the_time_to_rest(
    duration, overshoot, pause, lowpass, has_target
):
    """Half as long as the movement; the pause is as long as people need to see their error."""
    rule, size = MovementRule(lowpass=lowpass), np.radians(40.0)
    later = 0.5 * duration
    found = {}
    for extra in (0.0, overshoot):
        parts, at = [], []
        for k, sign in enumerate((1.0, -1.0, 1.0, -1.0)):
            start = 1.0 + 3.0 * k
            at.append((start - 0.2, sign * size))
            parts.append((start, duration, sign * size * (1.0 + extra)))
            parts.append((start + duration + pause, later, -sign * size * extra))
        time, angle = record(parts, 13.0)
        motion = kinematics(time, angle, rule)
        stretches = steps(time, *at) if has_target else rest_stretches(motion, rule, least=0.05)
        own, none = movements(motion, stretches, rule)
        assert len(own) == 4
        assert not none
        found[extra] = own
    true = (pause + later) / duration
    ratio = np.mean([m.duration for m in found[overshoot]]) / np.mean([m.duration for m in found[0.0]]) - 1.0
    assert ratio == pytest.approx(true, abs=0.2)
    assert [m.corrections for m in found[overshoot]] == [1] * 4
    assert [m.corrections for m in found[0.0]] == [0] * 4
    for m in found[overshoot]:
        assert m.first_arrival + m.after_arrival == pytest.approx(m.duration)
        assert m.first_arrival == pytest.approx(found[0.0][0].duration, rel=0.1)
    assert max(m.after_arrival for m in found[0.0]) < 2.0 / FS


def test_every_definition_of_the_end_has_its_value_and_sentence():
    time, angle = record([(1.0, 0.8, 0.6)], 4.0)
    found = pl.movement_indices(time, angle)
    assert set(MOVEMENT_DEFINITIONS) <= set(found)
    page = (Path(__file__).parents[2] / "docs" / "transparency-indices.md").read_text(encoding="utf-8")
    for name, words in MOVEMENT_DEFINITIONS.items():
        assert f"| `{name}` | {words} |" in page


def test_ringing_shrinks_with_the_duration_and_grows_with_the_order():
    shares = [ringing_share(periods, MovementRule()) for periods in (0.5, 1.0, 1.5, 2.0, 4.0)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 0.1 > 0.05 > shares[2]
    assert shares[-1] < 0.01
    assert ringing_share(1.0, MovementRule(order=2)) < ringing_share(1.0, MovementRule(order=8))


def test_the_main_movement_ends_at_a_reversal_and_its_rival_lies_across_a_valley():
    forward, backward, rival = np.hanning(41), -0.5 * np.hanning(21)[1:], 0.9 * np.hanning(31)[1:]
    velocity = np.concatenate([np.zeros(5), forward, backward, rival, np.zeros(4)])
    for way in (1.0, -1.0):
        found = _core.main_movement(way * velocity, 0.05, 0.8, 0.7)
        peak, start, stop, first, last, has_backward, height, valley = found
        speed = np.abs(velocity)
        assert (peak, has_backward) == (25, True)
        assert (first, last) == tuple(np.flatnonzero(speed > 0.05)[[0, -1]])
        assert (start, stop) == (first, 5 + np.flatnonzero(forward > 0.05)[-1] + 1)
        assert (height, valley) == pytest.approx((0.9, -0.5), rel=1e-12)
    # Without a valley, and for the peak alone, there is no rival.
    assert _core.main_movement(forward + 0.9 * np.roll(forward, 12), 0.05, 0.8, 0.1)[6:] == (0.0, 1.0)
    assert _core.main_movement(forward, 0.05, 0.8, 0.7)[1:] == (3, 38, 3, 37, False, 0.0, 1.0)
    with pytest.raises(ValueError, match="no sample"):
        _core.main_movement(np.zeros(0), 0.05, 0.8, 0.7)
