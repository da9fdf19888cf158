"""Covariances against the known ones, and against what repeated noise really does."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pellucid.fit.uncertainty import block_bootstrap, decorrelation_lag, long_run_covariance, sandwich, whiteness

N = 3000


def regressor(rng):
    time = np.arange(N) / 100.0
    return np.stack([np.sin(time), np.sign(np.sin(0.7 * time)), np.ones(N)], axis=1)


def coloured(rng, rho):
    return lfilter([np.sqrt(1 - rho**2)], [1.0, -rho], rng.standard_normal(N + 500))[500:]


def test_white_residuals_give_the_textbook_covariance():
    rng = np.random.default_rng(3)
    w, e = regressor(rng), rng.standard_normal(N)
    ours = np.sqrt(np.diag(sandwich(w, e, [N])))
    textbook = np.sqrt(np.diag(np.linalg.inv(w.T @ w)))
    assert ours == pytest.approx(textbook, rel=0.25)


@pytest.mark.parametrize("rho", [0.5, 0.9])
def test_coloured_residuals_give_the_spread_that_repetition_shows(rho):
    rng = np.random.default_rng(4)
    w = regressor(rng)
    errors, claimed = [], []
    for _ in range(200):
        e = coloured(rng, rho)
        step = np.linalg.lstsq(w, e, rcond=None)[0]
        errors.append(step)
        claimed.append(np.diag(sandwich(w, e - w @ step, [N])))
    real = np.std(errors, axis=0)
    assert np.sqrt(np.mean(claimed, axis=0)) == pytest.approx(real, rel=0.2)


def test_the_bootstrap_agrees_with_the_sandwich():
    rng = np.random.default_rng(5)
    w, e = regressor(rng), coloured(rng, 0.7)
    step = np.linalg.lstsq(w, e, rcond=None)[0]
    e = e - w @ step
    intervals = block_bootstrap(w, e, np.zeros(3), block=60, rng=rng, repetitions=600)
    half = 0.5 * (intervals[:, 1] - intervals[:, 0])
    assert half == pytest.approx(1.96 * np.sqrt(np.diag(sandwich(w, e, [N]))), rel=0.35)


def test_parameters_at_a_bound_do_not_spoil_the_others():
    rng = np.random.default_rng(6)
    w, e = regressor(rng), rng.standard_normal(N)
    free = np.array([True, True, False])
    covariance = sandwich(w, e, [N], free=free)
    assert covariance[2].tolist() == [0.0, 0.0, 0.0]
    assert covariance[:2, :2] == pytest.approx(sandwich(w[:, :2], e, [N]), rel=1e-6)


def test_stretches_are_independent():
    rng = np.random.default_rng(7)
    scores = coloured(rng, 0.9)[:, None]
    one, two = long_run_covariance(scores, [N]), long_run_covariance(scores, [N // 2, N // 2])
    assert two == pytest.approx(one, rel=0.2)


def test_whiteness_tells_white_from_coloured():
    rng = np.random.default_rng(8)
    white, colour = whiteness(rng.standard_normal(N), [N]), whiteness(coloured(rng, 0.9), [N])
    assert white.p_value > 0.01
    assert abs(white.lag1) < 0.06
    assert colour.p_value < 1e-6
    assert colour.lag1 == pytest.approx(0.9, abs=0.05)
    assert colour.effective_share < 0.2


def test_memory_is_longer_for_slower_noise():
    rng = np.random.default_rng(9)
    assert decorrelation_lag(rng.standard_normal(N)) <= 3
    assert decorrelation_lag(coloured(rng, 0.95)) > 20
