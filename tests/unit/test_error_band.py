"""Bands about a torque: how often they hold in a condition that was not there when they were made."""

import numpy as np
import pytest

from pellucid.emg.estimators.condition_choice import ERROR_BAND, find_error_band, find_left_out_coverage


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
        shares.append(np.mean(np.abs(new) <= find_error_band(known, count)))
    assert 0.85 <= np.mean(shares) <= 0.97


def test_a_band_is_wider_with_few_trials():
    rng = np.random.default_rng(1)
    errors = drawn_errors(rng, 1, 0.0)[0]
    widths = [find_error_band([errors] * count, count) for count in (2, 3, 6, 20)]
    assert widths == sorted(widths, reverse=True)
    assert widths[0] > 1.1 * widths[-1]
    assert widths[-1] == pytest.approx(np.quantile(np.abs(errors), ERROR_BAND.share), rel=0.03)


def test_the_check_within_fitted_trials_sees_a_band_that_fails():
    rng = np.random.default_rng(2)
    alike = drawn_errors(rng, 6, 0.2)
    assert 0.85 <= find_left_out_coverage(alike, 6) <= 0.99
    one_apart = [alike[0], alike[0], 100.0 * alike[0]]
    assert find_left_out_coverage(one_apart, 3) < 0.75


def test_parts_of_one_recording_and_missing_tests():
    parts = [np.full(10, 1.0), np.full(10, 7.0)]
    assert find_error_band(parts, 1) == pytest.approx(5.0)
    assert np.isnan(find_error_band([np.array([np.nan])], 3))
    assert find_error_band([np.full(10, 2.0), np.full(3, np.nan)], 3) == pytest.approx(2.0)
    assert find_left_out_coverage(parts, 2) is None
