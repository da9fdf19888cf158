"""One-way movements with corrections: made ones are found where they were put, and what is none is left out."""

import numpy as np
import pytest

from pellucid_lab.pointing.one_way_movements import OneWayRule, one_way_movements, robust_spread

RATE = 250.0


def minimum_jerk(time, begin, duration):
    s = np.clip((time - begin) / duration, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def record(*steps, seconds=3.0):
    """Place [m] of submovements (begin [s], duration [s], amplitude [m])."""
    time = np.arange(0.0, seconds, 1.0 / RATE)
    return time, sum(amplitude * minimum_jerk(time, begin, duration) for begin, duration, amplitude in steps)


def test_a_correction_belongs_to_its_movement_and_the_first_stop_does_not():
    time, place = record((0.5, 0.5, 0.140), (1.3, 0.3, 0.010), (2.4, 0.5, -0.150))
    (one,) = one_way_movements(time, place)
    # A minimum jerk's speed is below a twentieth of its peak for its first and last 4.2 %.
    assert one.onset == pytest.approx(0.5 + 0.042 * 0.5, abs=0.02)
    assert one.first_stop == pytest.approx(1.0 - 0.042 * 0.5, abs=0.02)
    assert one.first_place == pytest.approx(0.140, abs=5e-4)
    assert one.end == pytest.approx(1.6, abs=0.05)
    assert one.place == pytest.approx(0.150, abs=2e-4)
    assert one.duration == one.end - one.onset


def test_what_was_not_seen_is_no_movement():
    time, place = record((0.5, 0.5, 0.150))
    assert len(one_way_movements(time, place)) == 1
    lost = (time > 0.6) & (time < 0.7)
    assert one_way_movements(time[~lost], place[~lost]) == []
    patient = OneWayRule(gap=0.2)
    assert len(one_way_movements(time[~lost], place[~lost], patient)) == 1
    assert one_way_movements(time, place, OneWayRule(longest=0.1)) == []
    assert one_way_movements(time[:1], place[:1]) == []
    assert one_way_movements(time[:5], place[:5]) == []


def test_a_pointer_that_starts_beyond_the_line_or_never_rests_made_no_movement():
    time, place = record((0.5, 0.5, -0.150))
    assert one_way_movements(time, 0.150 + place) == []
    time, place = record((0.5, 0.4, 0.150), (0.9, 0.4, -0.150))
    restless = place + 0.002 * np.sin(2 * np.pi * 5.0 * time)
    assert one_way_movements(time, restless) == []


def test_equal_times_and_unknown_places_are_left_out():
    time, place = record((0.5, 0.5, 0.150))
    (whole,) = one_way_movements(time, place)
    again, holes = np.repeat(time, 2), np.repeat(place, 2)
    holes[200] = np.nan
    (one,) = one_way_movements(again, holes)
    assert one.duration == pytest.approx(whole.duration, abs=0.005)


def test_the_robust_spread_is_that_of_a_normal_without_its_outliers():
    values = np.random.default_rng(1).standard_normal(20_000)
    assert robust_spread(values) == pytest.approx(1.0, abs=0.02)
    values[:200] = 50.0
    assert robust_spread(values) == pytest.approx(1.0, abs=0.04)
