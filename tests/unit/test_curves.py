"""Curves between conditions: against SPM's own package, by counting, and at the margin."""

import itertools

import numpy as np
import pytest
from scipy import stats

from pellucid._errors import PellucidError
from pellucid.people.curves import compare_curves, resample_movement
from pellucid.people.equivalence import Margin


def smooth(rng, people, points=101, width=21):
    """Curves of standard deviation 1, correlated over about `width` times."""
    window = np.hanning(width)
    window /= np.linalg.norm(window)
    return np.array([np.convolve(rng.standard_normal(points + width - 1), window, "valid") for _ in range(people)])


def test_t_and_its_largest_are_those_of_spm1d(rng):
    spm1d = pytest.importorskip("spm1d", reason="no package spm1d: pip install spm1d")
    a = smooth(rng, 7)
    b = a + 0.5 + 0.6 * smooth(rng, 7)
    found = compare_curves(b - a)
    assert found.t == pytest.approx(spm1d.stats.ttest_paired(b, a).z, rel=1e-9)
    theirs = spm1d.stats.nonparam.ttest_paired(b, a)
    # 128 signs: theirs lies between two of them, ours on one.
    inference = theirs.inference(0.05, two_tailed=True, iterations=-1)
    assert found.critical == pytest.approx(inference.zstar, rel=0.1)
    largest = np.sort([np.abs(stats.ttest_1samp(s * (b - a), 0.0).statistic).max() for s in signs(7)])
    assert found.critical == pytest.approx(largest[int(np.ceil(0.95 * 127))], rel=1e-9)


def signs(n):
    return [np.array(each)[:, None] for each in itertools.product((-1.0, 1.0), repeat=n)]


def test_a_clusters_p_is_counted(rng):
    d = smooth(rng, 6, 40) + 1.2 * (np.arange(40) > 20)
    found = compare_curves(d)
    point = stats.t.isf(0.025, 5)

    def masses(t):
        sums = [0.0]
        for side in (t, -t):
            for inside, run in itertools.groupby(side, key=lambda x: x > point):
                sums += [sum(run)] if inside else []
        return sums

    chance = [max(masses(stats.ttest_1samp(s * d, 0.0).statistic)) for s in signs(6)]
    assert found.clusters
    for each in found.clusters:
        assert each.p_value == np.mean(np.array(chance) >= each.mass * (1.0 - 1e-9))


def test_clusters_are_found_by_chance_as_often_as_they_say():
    rng = np.random.default_rng(5)
    hits = sum(any(c.p_value <= 0.05 for c in compare_curves(smooth(rng, 6, 61)).clusters) for _ in range(200))
    assert 0.01 <= hits / 200 <= 0.09


def test_within_all_along_is_each_times_own_two_tests(rng):
    d = 0.1 * smooth(rng, 8) + 0.05
    found = compare_curves(d, Margin.either_way(0.3))
    sides = ((d + 0.3, "greater"), (d - 0.3, "less"))
    largest = max(stats.ttest_1samp(each, 0.0, alternative=way).pvalue.max() for each, way in sides)
    assert found.p_within == pytest.approx(largest, rel=1e-9)
    assert found.verdict == "within"
    beyond = compare_curves(d + 1.0 * (np.arange(101) > 80), Margin.either_way(0.3))
    assert (beyond.verdict, beyond.p_within > 0.9) == ("beyond", True)
    assert compare_curves(d).verdict == ""


def test_at_the_margin_within_errs_as_often_as_it_says():
    """A bump that touches the margin at one time: there alone the claim hangs."""
    rng = np.random.default_rng(6)
    bump = np.exp(-0.5 * ((np.arange(61) - 30.0) / 6.0) ** 2)
    said = [
        compare_curves(0.15 * smooth(rng, 6, 61) + bump, Margin.either_way(1.0)).p_within <= 0.05 for _ in range(200)
    ]
    assert 0.01 <= np.mean(said) <= 0.09


def test_the_band_holds_the_whole_curve():
    rng = np.random.default_rng(8)
    held = [((f := compare_curves(smooth(rng, 6, 61))).low <= 0.0).all() and (f.high >= 0.0).all() for _ in range(120)]
    assert 0.85 <= np.mean(held) <= 0.97


def test_more_people_than_signs_are_counted_for_are_drawn_alike(rng):
    d = smooth(rng, 14, 30)
    one, other = compare_curves(d), compare_curves(d)
    assert one.critical == other.critical
    with pytest.raises(PellucidError, match="n >= 3"):
        compare_curves(d[:2])


def test_a_movements_time_runs_from_its_start_to_its_end():
    time = np.arange(0.0, 2.0, 0.01)
    curve = resample_movement(time, np.sin(np.pi * (time - 0.5)), 0.5, 1.0)
    assert curve == pytest.approx(np.sin(np.pi * np.linspace(0.0, 1.0, 101)), abs=1e-3)
