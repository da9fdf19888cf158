"""Bands about a torque: how often they hold in a condition that was not there when they were made."""

import numpy as np
import pytest

from pellucid.emg.estimators.condition_choice import (
    ERROR_BAND,
    ConditionTestErrors,
    combine_tests,
    find_error_band,
    find_left_out_coverage,
    recommend,
)


def drawn_errors(rng, count, deviation, heavy=False):
    """Return errors of trials whose scales differ; a generator that is not the band's: they are correlated in time."""
    trials = []
    for _ in range(count):
        noise = rng.standard_t(4, 400) if heavy else rng.standard_normal(400)
        scale = np.exp(deviation * rng.uniform(-1.7, 1.7))
        trials.append(scale * np.convolve(noise, np.full(5, 0.2), mode="same"))
    return trials


@pytest.mark.parametrize("count", [2, 3, 5, 9])
@pytest.mark.parametrize(("deviation", "heavy"), [(0.15, False), (0.3, True), (0.5, False)])
def test_a_band_holds_in_another_trial(count, deviation, heavy):
    rng, shares = np.random.default_rng(count), []
    for _ in range(60):
        *known, new = drawn_errors(rng, count + 1, deviation, heavy)
        shares.append(np.mean(np.abs(new) <= find_error_band(known)))
    assert 0.85 <= np.mean(shares) <= 0.97


def test_a_band_is_wider_with_few_trials():
    rng = np.random.default_rng(1)
    errors = drawn_errors(rng, 1, 0.0)[0]
    widths = [find_error_band([errors] * count) for count in (2, 3, 6, 20)]
    assert widths == sorted(widths, reverse=True)
    assert widths[0] > 1.1 * widths[-1]
    assert widths[-1] == pytest.approx(np.quantile(np.abs(errors), ERROR_BAND.share), rel=0.03)


def test_the_check_within_fitted_trials_sees_a_band_that_fails():
    rng = np.random.default_rng(2)
    alike = drawn_errors(rng, 6, 0.2)
    assert 0.85 <= find_left_out_coverage(alike) <= 0.99
    one_apart = [alike[0], alike[0], 100.0 * alike[0]]
    assert find_left_out_coverage(one_apart) < 0.75


def test_missing_tests():
    assert np.isnan(find_error_band([np.array([np.nan])]))
    both = [np.full(10, 2.0), np.full(3, np.nan)]
    assert find_error_band(both) == pytest.approx(find_error_band(both[:1]))
    assert find_error_band(both[:1]) > 2.0
    assert find_left_out_coverage([np.full(10, 1.0), np.full(10, 7.0)]) is None


def strides(rng, count):
    """Return errors of candidates in strides, within which every error stays the same, shape (candidates, n)."""
    return np.repeat(rng.standard_normal((12, count)), 20, axis=1)


def test_the_band_of_a_weighted_mean_carries_the_choice_of_its_weights():
    rng, covered, naive = np.random.default_rng(5), [], []
    for _ in range(80):
        halves = [strides(rng, 4) for _ in range(2)]
        blocks = np.concatenate(halves, axis=1).reshape(12, 4, 40)
        found = {
            f"candidate {k}": ConditionTestErrors(
                tuple("abcd"), (1.0,) * 4, 1.0, errors=tuple(blocks[k]), band_errors=tuple(h[k] for h in halves)
            )
            for k in range(12)
        }
        chosen, new = recommend(found), strides(rng, 40)
        error = np.abs(chosen.predict(dict(zip(found, new, strict=True))))
        covered.append(np.mean(error <= combine_tests(found, chosen).half_width))
        seen = [chosen.predict(dict(zip(found, half, strict=True))) for half in halves]
        naive.append(np.mean(error <= find_error_band(seen)))
    assert 0.85 <= np.mean(covered) <= 0.95
    assert np.mean(naive) < 0.8
