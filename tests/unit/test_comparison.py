"""Signed ranks against SciPy, Holm against a worked example, intervals against how often they hold, effect sizes."""

import numpy as np
import pytest
from scipy import stats

from pellucid._errors import PellucidError
from pellucid.numerics.block_test import holm
from pellucid.people.comparison import (
    compare_conditions,
    friedman,
    mean_interval,
    nemenyi,
    sign_distribution,
    signed_rank,
    smallest_p,
    tells_from_control,
)


@pytest.mark.parametrize("n", [4, 9, 20])
def test_signed_ranks_are_scipys(n):
    d = np.random.default_rng(n).normal(0.4, 1.0, n)
    ours, theirs = signed_rank(d), stats.wilcoxon(d, method="exact")
    assert ours.p_value == pytest.approx(theirs.pvalue, rel=1e-12)
    assert min(ours.statistic, n * (n + 1) / 2 - ours.statistic) == theirs.statistic


def test_ties_are_counted_too():
    """By hand: ranks 1.5, 1.5, 3 with signs + - +; of 8 outcomes W+ is as far from 3 as 4.5 in 6."""
    found = signed_rank(np.array([1.0, -1.0, 2.0, 0.0]))
    assert found.pairs == 3
    assert found.statistic == 4.5
    assert found.p_value == 6.0 / 8.0
    assert found.rank_biserial == pytest.approx((4.5 - 1.5) / 6.0)


def test_the_smallest_p_is_that_of_all_on_one_side():
    for n in (2, 5, 6, 10):
        assert signed_rank(np.arange(1.0, n + 1.0)).p_value == pytest.approx(smallest_p(n), rel=1e-12)
        assert sign_distribution(np.arange(1, n + 1)).sum() == pytest.approx(1.0)
    assert signed_rank(np.zeros(5)).p_value == 1.0


def test_holm_as_in_a_worked_example():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]


def test_holm_is_that_of_statsmodels():
    multitest = pytest.importorskip("statsmodels.stats.multitest")
    p = np.random.default_rng(3).uniform(0.0, 0.2, 7)
    assert holm(list(p)) == pytest.approx(list(multitest.multipletests(p, method="holm")[1]), rel=1e-12)


def test_intervals_of_six_hold_about_as_often_as_they_say():
    """Normal differences of six participants: a plain percentile interval holds in 86 %."""
    rng = np.random.default_rng(7)
    held = 0
    for _ in range(400):
        low, high = mean_interval(rng.normal(0.3, 1.0, 6), 0.95, rng)
        held += low <= 0.3 <= high
    assert 0.90 <= held / 400 <= 0.98
    assert np.isnan(mean_interval(np.ones(2), 0.95, rng)).all()


def test_a_comparison_holds_all_its_parts():
    rng = np.random.default_rng(2)
    values = rng.normal(1.0, 0.2, (6, 1)) + rng.normal(0.0, 0.02, (6, 4)) + np.array([0.0, 0.0, 0.2, 0.18])
    found = compare_conditions(values, ["Ctrl", "FC", "PCFr", "CLPC"], "Ctrl", rng=rng)
    assert found.friedman == friedman(values, exact=True)
    assert np.array_equal(found.nemenyi, nemenyi(values))
    assert found.kendall == pytest.approx(found.friedman.statistic / 18.0)
    assert found.pair("FC", "CLPC") == found.nemenyi[1, 3]
    fc, pcfr, _ = found.against_control
    d = values[:, 2] - values[:, 0]
    assert pcfr.condition == "PCFr"
    assert pcfr.change == pytest.approx(d.mean())
    assert pcfr.relative == pytest.approx(values[:, 2].mean() / values[:, 0].mean() - 1.0)
    assert pcfr.standardised == pytest.approx(d.mean() / d.std(ddof=1))
    assert pcfr.rank_biserial == 1.0
    assert pcfr.cliff == pytest.approx(np.mean(np.sign(values[:, 2][:, None] - values[:, 0])))
    assert pcfr.interval[0] < pcfr.change < pcfr.interval[1]
    assert pcfr.p_value == 2.0**-5
    assert pcfr.holm == pytest.approx(3.0 * 2.0**-5)
    assert fc.holm >= fc.p_value


def test_kendalls_w_is_one_where_all_agree():
    values = np.arange(4.0) + np.array([[0.1], [0.2], [0.3]])
    assert compare_conditions(values, list("abcd"), "a", rng=np.random.default_rng(0)).kendall == pytest.approx(1.0)


def test_one_participant_is_described_and_not_tested():
    found = compare_conditions(np.array([[1.0, 2.0]]), ["a", "b"], "a", rng=np.random.default_rng(0))
    assert found.friedman is None
    assert found.against_control == ()
    assert np.isnan(found.pair("a", "b"))


def test_many_conditions_are_tested_without_counting():
    values = np.random.default_rng(1).normal(size=(12, 8))
    found = compare_conditions(values, list("abcdefgh"), "a", rng=np.random.default_rng(0))
    assert found.friedman.exact_p_value is None
    assert 0.0 < found.friedman.p_value < 1.0


@pytest.mark.parametrize(("people", "conditions"), [(4, 2), (6, 2), (9, 2), (5, 3), (6, 4), (5, 5)])
def test_many_studies_are_told_apart_as_each_alone_is(people, conditions):
    values = np.random.default_rng(people).normal(size=(60, people, conditions))
    values[:, :, 1] += np.linspace(0.0, 3.0, 60)[:, None]
    names = [f"c{j}" for j in range(conditions)]
    told = []
    for study in values:
        found = compare_conditions(study, names, "c0")
        told.append([found.p_value < 0.05 and found.pair("c0", name) < 0.05 for name in names])
    assert tells_from_control(values).tolist() == told


def test_missing_values_are_refused():
    with pytest.raises(PellucidError, match=r"no value of participant 0 \(row\) in b, and 1 of 1"):
        compare_conditions(np.array([[1.0, np.nan]]), ["a", "b"])
    with pytest.raises(PellucidError, match="finite numbers"):
        signed_rank(np.array([np.nan]))


def test_shares_of_control_are_held_against_nothing():
    """EMG/Acc has no column of control: every condition is a change already."""
    values = np.array([[0.1, 0.4], [0.2, 0.5], [-0.1, 0.3], [0.05, 0.6], [0.15, 0.45]])
    found = compare_conditions(values, ["FC", "CLPC"], against_zero=True, rng=np.random.default_rng(0))
    fc, clpc = found.against_control
    assert (fc.condition, clpc.condition) == ("FC", "CLPC")
    assert fc.change == pytest.approx(values[:, 0].mean())
    assert clpc.p_value == signed_rank(values[:, 1]).p_value == 2.0**-4
    assert clpc.holm == pytest.approx(2.0 * 2.0**-4)
    assert fc.interval[0] < 0.0 < clpc.interval[0]
    assert fc.relative is None


def test_participants_who_lack_a_value_may_be_left_out():
    values = np.random.default_rng(3).normal(size=(7, 3)) + np.array([0.0, 0.0, 5.0])
    values[2, 1] = np.nan
    found = compare_conditions(values, ["Ctrl", "FC", "CLPC"], "Ctrl", missing="leave out")
    without = compare_conditions(np.delete(values, 2, axis=0), ["Ctrl", "FC", "CLPC"], "Ctrl")
    assert found.left_out == (2,)
    assert found.friedman == without.friedman
    assert found.pairwise == without.pairwise
    assert found.pairwise["CLPC"].p == found.pairwise["CLPC"].holm == pytest.approx(2.0 * 2.0**-5)
    assert found.friedman.p == found.friedman.exact_p_value


def test_a_comparison_can_be_read():
    values = np.random.default_rng(3).normal(size=(7, 3)) + np.array([0.0, 0.0, 5.0])
    found = compare_conditions(values, ["Ctrl", "F<C", "CLPC"], "Ctrl", confidence=0.9)
    assert str(found).splitlines()[0].startswith("7 participants, 3 conditions: Friedman chi2(2) = ")
    assert "90 % interval" in str(found)
    assert "F&lt;C" in found._repr_html_()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"control": "Control"}, "found the control 'Control', expected one of a, b"),
        ({"conditions": ["a", "a"]}, "expected each name once"),
        ({"conditions": ["a"]}, r"found values of shape \(3, 2\), expected participants x 1 conditions"),
        ({"confidence": 95}, "found the confidence 95"),
        ({"missing": "drop"}, "found missing = 'drop'"),
    ],
)
def test_a_comparison_that_makes_no_sense_is_refused(changed, said):
    asked = {"conditions": ["a", "b"], "control": "a", **changed}
    with pytest.raises(PellucidError, match=said):
        compare_conditions(np.eye(3, 2), **asked)
