"""Friedman's test against SciPy, its exact p against a list of all outcomes, Nemenyi's against known values."""

from itertools import permutations, product

import numpy as np
import pytest
from scipy import stats

from pellucid import _errors
from pellucid.numerics.studentized_range import range_quantile, range_tail
from pellucid.people.comparison import friedman, friedman_from_rank_sums, nemenyi, nemenyi_from_rank_sums


def listed_p(data: np.ndarray) -> float:
    """The exact p by going through every order of every row's ranks."""
    ranks = stats.rankdata(data, axis=1)
    middle = 0.5 * len(ranks) * (ranks.shape[1] + 1)

    def spread(rows):
        return round(float(np.sum((np.sum(rows, axis=0) - middle) ** 2)), 6)

    seen = spread(ranks)
    outcomes = [spread(rows) >= seen for rows in product(*(list(permutations(row)) for row in ranks))]
    return float(np.mean(outcomes))


@pytest.mark.parametrize(("n", "k", "levels"), [(6, 4, None), (12, 3, None), (9, 5, None), (7, 4, 3), (20, 3, 2)])
def test_the_statistic_is_scipys_with_ties_and_without(n, k, levels):
    rng = np.random.default_rng(n * k)
    data = rng.normal(size=(n, k)) if levels is None else rng.integers(0, levels, (n, k)).astype(float)
    ours, theirs = friedman(data), stats.friedmanchisquare(*data.T)
    assert ours.statistic == pytest.approx(theirs.statistic, rel=1e-12)
    assert ours.p_value == pytest.approx(theirs.pvalue, rel=1e-12)
    assert ours.exact_p_value is None
    assert ours.degrees_of_freedom == k - 1


@pytest.mark.parametrize(("n", "k", "levels"), [(3, 3, None), (4, 3, 3), (3, 4, None), (3, 4, 3), (5, 2, None)])
@pytest.mark.parametrize("seed", range(3))
def test_the_exact_p_is_that_of_all_outcomes_listed(n, k, levels, seed):
    rng = np.random.default_rng(seed)
    data = rng.normal(size=(n, k)) if levels is None else rng.integers(0, levels, (n, k)).astype(float)
    assert friedman(data, exact=True).exact_p_value == pytest.approx(listed_p(data), rel=1e-9)


def test_full_agreement_has_the_smallest_exact_p():
    """Of (3!)^6 outcomes 3! agree in full: whichever order it is that all share."""
    data = np.tile([1.0, 2.0, 3.0], (6, 1))
    assert friedman(data, exact=True).exact_p_value == pytest.approx(6.0 / 6.0**6, rel=1e-12)


def test_no_difference_has_an_exact_p_of_one():
    data = np.array([[1.0, 2.0, 3.0], [2.0, 3.0, 1.0], [3.0, 1.0, 2.0]])
    result = friedman(data, exact=True)
    assert result.statistic == 0.0
    assert result.exact_p_value == pytest.approx(1.0, rel=1e-12)


def test_for_many_participants_the_exact_p_nears_the_chi_squared_one():
    data = np.random.default_rng(3).normal(size=(40, 3)) + np.array([0.0, 0.2, 0.4])
    result = friedman(data, exact=True)
    assert 0.005 < result.p_value < 0.95
    assert result.exact_p_value == pytest.approx(result.p_value, abs=0.01)


def test_ranks_alone_matter():
    data = np.random.default_rng(8).normal(size=(6, 4))
    assert friedman(np.exp(3.0 * data), exact=True) == friedman(data, exact=True)
    assert np.array_equal(nemenyi(np.exp(3.0 * data)), nemenyi(data))


def test_rank_sums_say_the_same_as_data_without_ties():
    data = np.random.default_rng(4).normal(size=(6, 4))
    whole = friedman(data, exact=True)
    short = friedman_from_rank_sums(whole.rank_sums, 6, exact=True)
    assert short.statistic == pytest.approx(whole.statistic, rel=1e-12)
    assert short.exact_p_value == pytest.approx(whole.exact_p_value, rel=1e-12)
    assert np.array_equal(nemenyi_from_rank_sums(whole.rank_sums, 6), nemenyi(data))


def test_nemenyi_holds_the_tables_critical_values():
    """Demsar 2006, table 5a: critical q at 5 % (already divided by the root of 2) for 2 to 5 conditions."""
    n = 1000
    for k, q in ((2, 1.960), (3, 2.343), (4, 2.569), (5, 2.728)):
        apart = q * np.sqrt(k * (k + 1) / (6.0 * n)) * n
        sums = np.full(k, 0.5 * n * (k + 1))
        sums[0] -= 0.5 * apart
        sums[-1] += 0.5 * apart
        p = nemenyi_from_rank_sums(sums, n)
        assert p[0, -1] == pytest.approx(0.05, abs=1e-4)
        assert np.array_equal(p, p.T)
        assert np.all(np.diag(p) == 1.0)


@pytest.mark.parametrize("count", [2, 3, 4, 6, 10])
def test_the_range_of_normal_numbers_is_scipys(count):
    value = np.linspace(0.0, 9.0, 30)
    expected = stats.studentized_range.sf(value, count, np.inf)
    np.testing.assert_allclose(range_tail(value, count), expected, rtol=0.0, atol=1e-12)
    assert range_quantile(0.05, count) == pytest.approx(stats.studentized_range.isf(0.05, count, np.inf), rel=1e-11)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: friedman(np.ones((4, 3))), "found equal values"),
        (lambda: friedman(np.arange(6.0)), "participants x conditions"),
        (lambda: friedman(np.array([[1.0, 2.0], [np.nan, 3.0]])), "participant 1, condition 0"),
        (lambda: friedman_from_rank_sums((9, 9, 21, 20), 6), "cannot come from 6 rankings"),
        (lambda: nemenyi_from_rank_sums((5, 7, 24, 24), 6), r"lie in \[6, 24\]"),
        (lambda: friedman(np.random.default_rng(0).normal(size=(4, 7)), exact=True), "expected at most 6"),
        (lambda: friedman(np.random.default_rng(0).normal(size=(30, 6)), exact=True), "expected fewer for the exact"),
    ],
)
def test_misuse_is_refused_with_a_reason(call, said):
    with pytest.raises(_errors.PellucidError, match=said):
        call()


@pytest.mark.parametrize(("n", "k"), [(6, 4), (12, 3), (9, 5)])
def test_nemenyi_is_that_of_scikit_posthocs(n, k):
    posthocs = pytest.importorskip("scikit_posthocs", reason="no package scikit-posthocs: pip install scikit-posthocs")
    data = np.random.default_rng(n + k).normal(size=(n, k)) + 0.4 * np.arange(k)
    assert nemenyi(data) == pytest.approx(posthocs.posthoc_nemenyi_friedman(data).to_numpy(), abs=1e-9)
