"""Ranks of data with a resolution of 0.01 against exact rational arithmetic: no p value is decided by rounding."""

from collections import Counter
from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from scipy import stats

from pellucid.numerics.tied_ranks import tie_groups, tied_ranks, tied_signs
from pellucid.people.assess_table import assess_table
from pellucid.people.comparison import compare_conditions, friedman, nemenyi, rank_sums, signed_rank
from pellucid.people.equivalence import Margin, equivalence

TABLES = 1_500
"""Tables of which each p value is compared."""


def exact_ranks(values):
    """Twice the mean rank of each of rational values: integers."""
    return [2 * sum(x < y for x in values) + sum(x == y for x in values) + 1 for y in values]


def exact_signed_rank_p(differences):
    """The two-sided p of signed ranks as a fraction, every sign counted."""
    d = [x for x in differences if x != 0]
    ranks = exact_ranks([abs(x) for x in d])
    above, total = sum(r for r, x in zip(ranks, d, strict=True) if x > 0), sum(ranks)
    ways = Counter({0: 1})
    for rank in ranks:
        ways = ways + Counter({value + rank: count for value, count in ways.items()})
    far = sum(count for value, count in ways.items() if abs(2 * value - total) >= abs(2 * above - total))
    return Fraction(far, 2 ** len(d)) if d else Fraction(1)


def exact_friedman_p(rows):
    """The p of Friedman's test as a fraction, every order of every row counted."""
    ranked = [exact_ranks(row) for row in rows]
    middle = len(rows) * (len(rows[0]) + 1)

    def spread(sums):
        return sum((s - middle) ** 2 for s in sums)

    ways = Counter({(0,) * len(rows[0]): 1})
    for row in ranked:
        ahead: Counter = Counter()
        for order, often in Counter(permutations(row)).items():
            for sums, count in ways.items():
                ahead[tuple(sorted(a + b for a, b in zip(sums, order, strict=True)))] += count * often
        ways = ahead
    seen = spread([sum(column) for column in zip(*ranked, strict=True)])
    return Fraction(sum(n for sums, n in ways.items() if spread(sums) >= seen), sum(ways.values()))


def table(seed):
    """Hundredths of participants and conditions, with an offset as that of a mean: from 0.1 to 1,000."""
    rng = np.random.default_rng([21, seed])
    n, k = int(rng.integers(4, 13)), int(rng.integers(2, 4))
    offset = int(rng.choice([10, 100, 1_000, 100_000]))
    return offset + rng.integers(-6, 7, (n, 1)) + rng.integers(-4, 5, (n, k)) + rng.integers(0, 3, k)


def test_signed_ranks_of_differences_of_hundredths_are_exact():
    decided_by_rounding = 0
    for seed in range(TABLES):
        hundredths = table(seed)
        values = hundredths / 100.0
        exact = exact_signed_rank_p([Fraction(int(b - a), 100) for a, b in hundredths[:, :2]])
        d = values[:, 1] - values[:, 0]
        assert signed_rank(d).p_value == pytest.approx(float(exact), rel=1e-9), seed
        assert signed_rank(d, float(values.max())).p_value == pytest.approx(float(exact), rel=1e-9), seed
        plain = stats.rankdata(np.abs(d[d != 0.0]))
        decided_by_rounding += not np.array_equal(plain, 0.5 * np.array(exact_ranks([abs(int(b - a))
            for a, b in hundredths[:, :2] if a != b])))  # fmt: skip
    assert decided_by_rounding > TABLES // 4  # else this test could not fail


def test_friedman_and_nemenyi_of_hundredths_are_exact():
    for seed in range(TABLES):
        hundredths = table(seed)
        if hundredths.shape[1] < 3 or not tie_groups(hundredths, axis=1).any():
            continue
        values = hundredths / 100.0
        found = friedman(values, exact=True)
        if seed % 10 == 0:
            exact = exact_friedman_p([[Fraction(int(x), 100) for x in row] for row in hundredths])
            assert found.exact_p_value == pytest.approx(float(exact), rel=1e-9), seed
        assert found == friedman(hundredths.astype(float), exact=True)
        np.testing.assert_array_equal(nemenyi(values), nemenyi(hundredths.astype(float)))


def test_means_of_three_trials_are_compared_exactly():
    """A mean of three hundredths is rounded, and so is its difference from another mean."""
    rng = np.random.default_rng(4)
    for seed in range(200):
        trials = rng.integers(70, 76, (9, 2, 3))
        values = (trials / 100.0).mean(axis=2)
        exact = [Fraction(int(b) - int(a), 300) for a, b in trials.sum(axis=2)]
        found = compare_conditions(values, ["free", "worn"], "free").pairwise["worn"]
        assert found.p_value == pytest.approx(float(exact_signed_rank_p(exact)), rel=1e-9), seed
        free, worn = trials.sum(axis=2).T
        signs = np.sign(worn[:, None] - free[None, :])
        assert found.cliff == pytest.approx(np.mean(signs), abs=1e-12)


def test_a_table_of_single_trials_is_compared_exactly():
    rng = np.random.default_rng(5)
    for seed in range(60):
        trials = rng.integers(70, 76, (8, 2, 4))
        rows = {"participant": [], "condition": [], "duration": []}
        for person, condition, trial in np.ndindex(trials.shape):
            rows["participant"].append(person)
            rows["condition"].append(("free", "worn")[condition])
            rows["duration"].append(trials[person, condition, trial] / 100.0)
        exact = exact_signed_rank_p([Fraction(int(b) - int(a), 400) for a, b in trials.sum(axis=2)])
        found = assess_table(rows, control="free")["duration"].pairwise["worn"]
        assert found.p_value == pytest.approx(float(exact), rel=1e-9), seed


def test_a_change_that_equals_the_margin_is_no_evidence_whatever_its_rounding():
    """0.07 - 0.02 is below 0.05 and 1.07 - 1.02 above it, in floating point."""
    for base in (0.02, 1.02, 10.02, 100.02):
        d = np.full(9, (base + 0.05) - base)
        assert equivalence(d, Margin.either_way(0.05), method="signed_rank").verdict == "undecided"
        assert equivalence(d, Margin.either_way(0.05), method="signed_rank").people_within == 9


def test_equal_values_that_were_computed_differently_do_not_differ():
    free = np.array([0.3, 0.6, 0.7, 1.1, 0.9])
    worn = np.array([0.1 + 0.2, 0.2 + 0.4, 0.1 * 7, 1.0 + 0.1, 3 * 0.3])
    assert (free != worn).any()
    found = compare_conditions(np.column_stack([free, worn]), ["free", "worn"], "free")
    assert found.friedman is None
    assert found.pairwise["worn"].p_value == 1.0
    assert found.pairwise["worn"].cliff == 0.0
    assert np.isnan(found.pairwise["worn"].standardised)


def test_ranks_keep_what_an_instrument_tells_apart():
    values = 1000.0 + 1e-6 * np.arange(20)
    assert tied_ranks(values).tolist() == list(range(1, 21))
    assert tied_ranks(np.array([1.0, np.inf, np.inf, 0.5])).tolist() == [2.0, 3.5, 3.5, 1.0]
    assert tied_signs(np.array([1e-16, -1e-3, 0.2]), 1.0).tolist() == [0.0, -1.0, 1.0]
    plain = np.random.default_rng(1).standard_normal((50, 9))
    np.testing.assert_array_equal(tied_ranks(plain, axis=1), stats.rankdata(plain, axis=1))
    np.testing.assert_array_equal(tied_ranks(plain, axis=0), stats.rankdata(plain, axis=0))
    tied = np.round(np.random.default_rng(1).standard_normal((6, 9, 5)), 1)
    for axis in range(3):
        np.testing.assert_array_equal(tied_ranks(tied, axis=axis), stats.rankdata(tied, axis=axis))
    w = [stats.wilcoxon(row, alternative="greater").statistic for row in plain]
    np.testing.assert_allclose(rank_sums(plain), w)
