"""Order, carry-over and learning: found where they were put, and taken out; against statsmodels where it has them."""

import numpy as np
import pytest
from scipy import stats

from pellucid.people.certificate import PASS, Doubt, certificate, certificate_from_tests
from pellucid.people.equivalence import Margin
from pellucid.people.mixed_model import carry_over, is_balanced, period_effect, thirds

WIDE = Margin.either_way(1.0)
WILLIAMS = ((0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1))


def test_the_period_is_told_from_the_change(rng):
    later = np.array([1.0, -1.0] * 6)
    d = 0.1 + 0.2 * later + rng.normal(0.0, 0.02, 12)
    found = period_effect(d, later, WIDE)
    assert found.effect == pytest.approx(0.2, abs=0.02)
    assert found.p_value < 0.01
    assert found.without.estimate == pytest.approx(0.1, abs=0.02)
    # Of both orders alike it is the mean of the two sequences' means, with their pooled error: Hills and Armitage.
    pooled = np.sqrt((d[::2].var(ddof=1) + d[1::2].var(ddof=1)) / 2.0 / 12.0)
    without = found.without.differences
    assert without.mean() == pytest.approx(d.mean(), rel=1e-12)
    assert without.std(ddof=1) / np.sqrt(12) == pytest.approx(pooled, rel=1e-9)
    assert period_effect(d, np.ones(12), WIDE) is None


def test_its_p_value_is_counted_and_its_error_that_of_least_squares(rng):
    later = np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    d = 0.1 + 0.03 * later + rng.normal(0.0, 0.05, 7)
    found = period_effect(d, later, WIDE)
    counted = stats.permutation_test(
        (d[:4], d[4:]), lambda a, b, axis: np.abs(a.mean(axis=axis) - b.mean(axis=axis)), vectorized=True,
        n_resamples=np.inf, alternative="greater",
    )  # fmt: skip
    assert found.p_value == pytest.approx(counted.pvalue, abs=1e-12)
    line = stats.linregress(later, d)
    assert found.effect == pytest.approx(line.slope)
    assert found.without.estimate == pytest.approx(line.intercept)
    without = found.without.differences
    assert without.std(ddof=1) / np.sqrt(7) == pytest.approx(line.intercept_stderr, rel=1e-9)


def test_stating_periods_in_balanced_orders_changes_no_decision(rng):
    later = np.array([1.0, -1.0] * 8)
    margin = Margin.either_way(0.06)
    for _ in range(200):
        d = rng.normal(0.0, 0.05, 16)
        plain = certificate({"duration": d}, {"duration": margin})
        effect = period_effect(d, later, margin)
        doubt = Doubt("period", effect.p_value, effect.without, never=is_balanced(later))
        told = certificate_from_tests(plain.end_points, 0.05, {"duration": (doubt,)})
        assert told.verdict == plain.verdict


def made(rng, people, lingers):
    """Values and periods of people in Williams' square, in which condition 2 leaves something for the next."""
    orders = np.array([WILLIAMS[i % 4] for i in range(people)])
    period = np.argsort(orders, axis=1) + 1
    values = rng.normal(0.0, 0.2, (people, 1)) + np.array([0.0, 0.1, 0.3, 0.05]) + 0.02 * period
    for i, order in enumerate(orders):
        values[i, order[1:]] += lingers * (order[:-1] == 2)
    return values + rng.normal(0.0, 0.03, values.shape), period


def test_what_lingers_is_found_and_taken_out(rng):
    values, period = made(rng, 12, 0.2)
    found = carry_over(values, period, 0, 1, WIDE)
    assert found.effect == pytest.approx(0.2, abs=0.05)
    assert found.p_value < 1e-4
    assert abs(found.without.estimate - 0.1) < 3.0 * (found.without.interval[1] - found.without.estimate) / 1.6
    assert carry_over(values, np.tile([1, 2, 3, 4], (12, 1)), 0, 1, WIDE) is None


def test_its_test_is_that_of_statsmodels(rng):
    api = pytest.importorskip("statsmodels.api")
    values, period = made(rng, 8, 0.05)
    found = carry_over(values, period, 0, 3, WIDE)
    rank, order = period - 1, np.argsort(period, axis=1)
    rows, y = [], []
    for i in range(8):
        for j in range(4):
            row = np.zeros(8 + 4 + 4 + 4)
            row[i] = row[8 + j] = row[12 + rank[i, j]] = 1.0
            if rank[i, j]:
                row[16 + order[i, rank[i, j] - 1]] = 1.0
            rows.append(row)
            y.append(values[i, j])
    # Of each kind of column but people's the first is what the others are told from.
    columns = [*range(8), 9, 10, 11, 13, 14, 15, 17, 18, 19]
    whole = api.OLS(y, np.array(rows)[:, columns]).fit()
    base = api.OLS(y, np.array(rows)[:, columns[:-3]]).fit()
    _, p, _ = whole.compare_f_test(base)
    assert found.p_value == pytest.approx(p, rel=1e-6)
    assert found.without.estimate == pytest.approx(whole.params[10], abs=1e-9)
    assert found.without.interval == pytest.approx(tuple(whole.conf_int(0.1)[10]), abs=1e-9)


def test_two_conditions_are_told_by_peoples_sums(rng):
    period = np.array([[1, 2], [2, 1]] * 5)
    values = rng.normal(0.0, 0.05, (10, 2)) + np.array([0.0, 0.1])
    lingering = values + 0.5 * ((period == 2) & np.array([True, False])[None, :])
    found = carry_over(lingering, period, 0, 1, WIDE)
    first = period[:, 1] == 1
    assert found.p_value == pytest.approx(
        stats.mannwhitneyu(*(lingering[s].sum(axis=1) for s in (first, ~first)), method="exact").pvalue
    )
    assert found.p_value < 0.01
    assert found.without.estimate == pytest.approx(lingering[first, 1].mean() - lingering[~first, 0].mean())


def test_thirds_show_a_drift_and_not_the_kinds_of_movements(rng):
    cells = ["short", "long", "middle"] * 10
    height = np.array([{"short": 0.0, "long": 1.0, "middle": 0.4}[cell] for cell in cells])
    assert thirds(height, cells).drift == pytest.approx(0.0, abs=1e-12)
    assert thirds(height - 0.01 * np.arange(30), cells).drift == pytest.approx(-0.2, abs=0.01)
    assert thirds([1.0] * 8, ["a"] * 8) is None


def test_a_doubt_takes_a_claim_away_and_never_makes_one(rng):
    margin = {"duration": Margin.of_ratio(0.1)}
    plain = certificate({"duration": rng.normal(0.0, 0.02, 14)}, margin)
    far = certificate({"duration": rng.normal(0.3, 0.02, 14)}, margin)
    own, other = plain.end_points["duration"], far.end_points["duration"]
    assert plain.verdict == PASS
    for p, without, said in ((0.01, other, "undecided"), (0.01, own, "within"), (0.2, other, "within")):
        doubted = certificate_from_tests({"duration": own}, 0.05, {"duration": (Doubt("learning", p, without),)})
        assert doubted.said_of("duration") == said
    assert (
        certificate_from_tests({"duration": other}, 0.05, {"duration": (Doubt("period", 0.01, own),)}).verdict
        == "cannot say"
    )
