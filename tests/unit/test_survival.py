"""Durations of which some were cut off: against SciPy's empirical distribution, and against what is known."""

import numpy as np
import pytest
from scipy import stats

from pellucid._errors import PellucidError
from pellucid.people.survival import survival


def test_the_curve_is_scipys():
    rng = np.random.default_rng(1)
    duration, ended = np.round(rng.exponential(1.0, 200), 2), rng.random(200) < 0.7
    found = survival(duration, ended)
    known = stats.ecdf(stats.CensoredData.right_censored(duration, ~ended)).sf
    steps = np.isin(known.quantiles, duration[ended])
    assert found.time == pytest.approx(known.quantiles[steps])
    assert found.share == pytest.approx(known.probabilities[steps])
    interval = known.confidence_interval(0.95, method="log-log")
    inner = (found.share < 1.0) & (found.share > 0.0)
    assert found.low[inner] == pytest.approx(interval.low.probabilities[steps][inner])
    assert found.high[inner] == pytest.approx(interval.high.probabilities[steps][inner])


def test_without_a_cut_it_is_the_share_that_is_longer_and_the_median_the_median():
    duration = np.array([3.0, 1.0, 2.0, 5.0, 4.0])
    found = survival(duration, np.ones(5, bool))
    assert found.share == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.0])
    assert found.median == 3.0
    assert found.cut == 0.0


def test_a_mean_moves_with_where_records_are_cut_and_a_median_does_not():
    rng = np.random.default_rng(2)
    true = rng.exponential(2.0, 20_000)
    found = [survival(np.minimum(true, cap), true < cap) for cap in (4.0, 20.0)]
    for each in found:
        assert each.median == pytest.approx(2.0 * np.log(2.0), rel=0.03)
    assert np.minimum(true, 4.0).mean() < 0.9 * np.minimum(true, 20.0).mean()
    assert found[0].cut == pytest.approx(np.exp(-2.0), abs=0.01)


def test_what_mostly_never_ends_has_no_median_but_a_bound():
    found = survival(np.array([1.0, 9.0, 9.0, 9.0]), np.array([True, False, False, False]))
    assert found.median == np.inf
    assert found.bounded_median == 9.0
    nothing = survival(np.array([9.0, 8.0]), np.zeros(2, bool))
    assert (len(nothing.time), nothing.median, nothing.cut) == (0, np.inf, 1.0)


@pytest.mark.parametrize("duration", [[], [np.nan, 1.0], [[1.0]]])
def test_what_is_no_duration_is_refused(duration):
    with pytest.raises(PellucidError, match="survival: found durations"):
        survival(np.array(duration), np.ones(np.shape(duration), bool))
