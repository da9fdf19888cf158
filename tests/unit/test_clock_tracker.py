"""A stream's clock is followed while it arrives: offset and drift, jumps either way, batches and lost samples."""

import numpy as np
import pytest

from pellucid.live.clock_tracker import JUMP_THRESHOLD_S, ClockTracker

RATE = 500.0


def arrive(tracker, stamps, clock, rng, start=0):
    """Let chunks of 10 samples arrive, measured at `stamps` and stamped by `clock`, late by 1 to 6 ms."""
    told = []
    for first in range(start, len(stamps), 10):
        chunk = stamps[first : first + 10]
        told.append(tracker.take(clock(chunk), chunk[-1] + rng.uniform(0.001, 0.006)))
    return np.concatenate(told)


@pytest.mark.parametrize(("offset", "drift"), [(0.0, 0.0), (-3600.0, 40e-6), (1e6, -80e-6)])
def test_offset_and_drift_are_found_within_the_smallest_delay(offset, drift):
    stamps = np.arange(0.0, 60.0, 1.0 / RATE)
    tracker = ClockTracker(RATE)
    told = arrive(tracker, stamps, lambda t: offset + t * (1.0 + drift), np.random.default_rng(1))
    state = tracker.state
    assert state.drift == pytest.approx(-drift, abs=5e-6)
    assert state.offset == pytest.approx(60.0 - (offset + 60.0 * (1.0 + drift)), abs=0.002)
    assert np.abs(told[1000:] - stamps[1000:]).max() < 0.0025
    assert (state.jumps, state.batches, state.lost) == (0, 0, 0)
    assert state.rate == pytest.approx(RATE * (1.0 - drift), rel=1e-5)


@pytest.mark.parametrize("jump", [0.5, -0.5, 0.05, -0.05])
def test_a_jump_is_counted_once_and_followed(jump):
    stamps = np.arange(0.0, 20.0, 1.0 / RATE)
    tracker = ClockTracker(RATE)
    told = arrive(tracker, stamps, lambda t: t + np.where(t >= 10.0, jump, 0.0), np.random.default_rng(2))
    assert tracker.state.jumps == 1
    assert np.abs(told[-2000:] - stamps[-2000:]).max() < 0.007


def test_first_samples_that_had_waited_are_no_jump():
    tracker = ClockTracker(100.0)
    tracker.take(np.arange(0.0, 0.5, 0.01), 0.7)  # sent before anybody listened, and all the later
    for stamp in np.arange(0.5, 8.0, 0.01):
        tracker.take(np.array([stamp]), stamp + 0.002)
    assert tracker.state.jumps == 0
    assert tracker.state.offset == pytest.approx(0.002, abs=1e-3)


def test_a_queue_that_is_emptied_at_once_is_no_jump():
    tracker, rng = ClockTracker(RATE), np.random.default_rng(3)
    stamps = np.arange(0.0, 10.0, 1.0 / RATE)
    arrive(tracker, stamps[:2500], lambda t: t, rng)
    tracker.take(stamps[2500:2800], stamps[2800])  # 0.6 s at once, a moment late
    arrive(tracker, stamps, lambda t: t, rng, start=2800)
    assert tracker.state.jumps == 0
    assert JUMP_THRESHOLD_S < 0.6


def test_lost_samples_are_counted_by_their_stamps():
    stamps = np.delete(np.arange(0.0, 4.0, 1.0 / RATE), [*range(100, 107), 500, 501])
    tracker = ClockTracker(RATE)
    arrive(tracker, stamps, lambda t: t, np.random.default_rng(4))
    assert tracker.state.lost == 9


def test_samples_of_one_stamp_are_batches_and_no_loss():
    tracker = ClockTracker(RATE)
    for i in range(100):
        tracker.take(np.full(10, 0.02 * i), 0.02 * i + 0.002)
    assert tracker.state.batches == 100
    assert tracker.state.lost == 0
