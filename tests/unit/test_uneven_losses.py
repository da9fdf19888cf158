"""The longest movements that one condition loses must not make it transparent."""

import numpy as np
import pytest

import pellucid as pl
from pellucid.people.certificate import UNEVEN_LOSSES_DOUBT
from pellucid.people.uneven_losses import completed_values, excess_losses

MARGIN = {"duration": 0.10}


def table(seed, *, change, lost, of=("worn",), people=16, movements=40, spread=0.4):
    """Return a table of movements of people whom a robot slows by a factor, without the longest ones of conditions."""
    rng = np.random.default_rng(seed)
    found = {"participant": [], "condition": [], "duration": []}
    for p in range(people):
        pace, own = np.exp(0.1 * rng.standard_normal()), change * np.exp(0.01 * rng.standard_normal())
        for condition in ("free", "worn"):
            times = pace * np.exp(spread * rng.standard_normal(movements))
            times *= own if condition == "worn" else 1.0
            if condition in of:
                times[times > np.quantile(times, 1.0 - lost)] = np.nan
            found["participant"] += [f"P{p}"] * movements
            found["condition"] += [condition] * movements
            found["duration"] += times.tolist()
    return found


def certified(data, **more):
    return pl.assess(data, control="free", margins=MARGIN, **more).certificates["worn"]


def test_a_slower_robot_is_not_transparent_because_its_longest_movements_are_lost():
    found = [certified(table(seed, change=1.13, lost=0.09)) for seed in range(8)]
    assert any(own.tested("duration") == "within" for own in found)
    assert not any(own.verdict == "transparent" for own in found)
    doubted = next(own for own in found if own.tested("duration") == "within")
    assert [doubt.what for doubt in doubted.contradicted("duration")] == [UNEVEN_LOSSES_DOUBT]


def test_the_completed_change_is_near_the_true_one():
    found = [certified(table(seed, change=1.13, lost=0.09)) for seed in range(8)]
    completed = [d.without.estimate for own in found for d in own.doubts["duration"] if d.what == UNEVEN_LOSSES_DOUBT]
    assert np.expm1(np.mean(completed)) == pytest.approx(0.13, abs=0.03)
    assert np.expm1(np.mean([own.end_points["duration"].estimate for own in found])) < 0.06


def test_losses_that_both_conditions_have_alike_cost_nothing():
    data = table(3, change=1.0, lost=0.09, of=("free", "worn"), spread=0.1)
    assert certified(data).verdict == "transparent"
    assert not certified(data).doubts["duration"]


def test_conditions_with_other_numbers_of_movements_by_design_lose_none():
    data = table(3, change=1.0, lost=0.09, spread=0.1)
    kept = np.isfinite(data["duration"])
    shorter = {name: [v for v, k in zip(values, kept, strict=True) if k] for name, values in data.items()}
    assert certified(data).doubts["duration"]
    assert not certified(shorter, max_left_out=1.0).doubts["duration"]


def test_excess_is_that_of_the_condition_that_lost_more():
    assert excess_losses({"free": (3, 100), "worn": (10, 100)}, ("free", "worn")) == ("worn", pytest.approx(0.07))
    assert excess_losses({"free": (10, 100), "worn": (3, 100)}, ("free", "worn")) == ("free", pytest.approx(0.07))
    assert excess_losses({"free": (5, 100), "worn": (10, 200)}, ("free", "worn")) is None


def test_values_are_completed_beyond_the_most_extreme_one():
    keys = [("P", "free", 0)] * 3 + [("P", "worn", 0)] * 3
    values = np.array([1.0, 2.0, 3.0, 1.0, 2.0, 4.0])
    up = completed_values(values, keys, "worn", 0.1, upwards=True)
    down = completed_values(values, keys, "worn", 0.1, upwards=False)
    np.testing.assert_array_equal(up[:3], values[:3])
    assert np.mean(up[3:]) == pytest.approx(0.9 * 7.0 / 3.0 + 0.1 * 2.0 * 2.0**1.5)
    assert np.mean(down[3:]) == pytest.approx(0.9 * 7.0 / 3.0 + 0.1 * 2.0 * 0.5**1.5)
    signed = completed_values(values - 2.0, keys, "worn", 0.1, upwards=True)
    assert np.mean(signed[3:]) == pytest.approx(0.9 / 3.0 + 0.1 * 3.0)
