"""Shares of people within and far beyond a margin: against tables, at their level, and without a cliff."""

import numpy as np
import pytest
from scipy import stats

from pellucid.people.equivalence import Margin
from pellucid.people.movement_indices import SimulatedStudies, are_transparent
from pellucid.people.session_periods import adjustment
from pellucid.people.share_of_people import MODEL_PEOPLE, shape_p, share_p_values, share_test

MARGIN = Margin.either_way(1.0)


def transparent_share(people, spread, studies=2000, at=0.0, seed=5):
    rng = np.random.default_rng([seed, people])
    changes = at + spread * rng.standard_normal((studies, people, 1))
    return np.mean(are_transparent(SimulatedStudies(changes), [MARGIN]))


@pytest.mark.parametrize("people", [12, 20, 40])
def test_the_bound_of_one_end_is_the_published_tolerance_factor(people):
    """ISO 16269-6: the mean and k standard deviations below the end show at least 75 % below it at 90 %."""
    d = stats.norm.ppf((np.arange(people) + 0.5) / people)
    d = d / d.std(ddof=1)
    k = stats.nct.isf(0.10, people - 1, stats.norm.ppf(0.75) * np.sqrt(people)) / np.sqrt(people)
    found = share_test(d, d, Margin(-np.inf, k), adjustment(people, None))
    assert shape_p(d) > 0.05
    assert found.least_within == pytest.approx(0.75, abs=1e-4)
    assert found.p_within == pytest.approx(0.10, abs=1e-6)


def test_from_sixty_people_on_it_is_clopper_and_pearson():
    statsmodels = pytest.importorskip("statsmodels.stats.proportion")
    d = np.concatenate([np.zeros(55), np.full(5, 2.0), [9.0]])
    found = share_test(d, d, MARGIN, adjustment(61, None))
    assert (found.people, found.within, found.far) == (61, 55, 1)
    assert len(d) > MODEL_PEOPLE
    assert found.least_within == pytest.approx(statsmodels.proportion_confint(55, 61, 0.2, "beta")[0])
    assert found.most_far == pytest.approx(statsmodels.proportion_confint(1, 61, 0.2, "beta")[1])


def test_it_holds_its_level_with_three_in_four_within():
    rng, plain = np.random.default_rng(7), adjustment(14, None)
    for mean, spread in ((0.0, 1.0 / stats.norm.ppf(0.875)), (0.7, 0.3 / stats.norm.ppf(0.75))):
        d = mean + spread * rng.standard_normal((20_000, 14))
        p, _ = share_p_values(d, d, MARGIN, plain)
        assert 0.06 < np.mean(p <= 0.10) < 0.115


def test_the_verdict_answers_the_bounds():
    rng = np.random.default_rng(11)
    for people in (12, 20, 45, 70):
        for spread in (0.2, 0.5, 0.8):
            d = spread * rng.standard_t(4, people)
            found = share_test(d, d, MARGIN, adjustment(people, None))
            shown = found.least_within >= 0.75 and found.most_far <= 0.05
            assert (found.answer == "shown") == shown


def test_power_has_no_cliff_and_goes_to_one():
    found = {n: transparent_share(n, 0.5) for n in (12, 14, 16, 58, 60, 400)}
    assert found[12] > 0.70
    assert max(abs(found[a] - found[b]) for a, b in ((12, 14), (14, 16), (58, 60))) < 0.30
    assert found[60] > 0.99
    assert found[400] == 1.0


def test_a_third_of_people_beyond_is_seldom_called_transparent():
    assert max(transparent_share(n, 1.0) for n in (12, 13, 14, 20, 59, 60, 120)) <= 0.05


def test_a_fifth_of_people_far_away_is_seldom_missed():
    rng = np.random.default_rng(2)
    for people in (12, 13, 14):
        slowed = rng.uniform(size=(8000, people)) < 0.2
        changes = rng.standard_normal(slowed.shape) / 3.0 + 5.0 * slowed
        assert np.mean(are_transparent(SimulatedStudies(changes[:, :, None]), [MARGIN])) < 0.065


def test_bounds_show_only_what_every_value_within_them_would():
    d = np.random.default_rng(4).normal(0.0, 0.1, 70)
    upper = np.where(np.arange(70) < 2, np.inf, d)
    plain = adjustment(70, None)
    known, cut = share_test(d, d, MARGIN, plain), share_test(d, upper, MARGIN, plain)
    assert (known.far, cut.far) == (0, 2)
    assert known.answer == "shown"
    assert cut.answer == "not shown"
