"""Covariances against the known ones, and against what repeated noise really does."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pellucid.numerics.uncertainty import (
    block_bootstrap,
    block_length,
    correlation_time,
    long_run_covariance,
    relative_error_factor,
    sandwich_covariance,
    student_to_normal_ratio,
    whiteness,
)

N = 3000


def regressor(rng):
    time = np.arange(N) / 100.0
    return np.stack([np.sin(time), np.sign(np.sin(0.7 * time)), np.ones(N)], axis=1)


def coloured(rng, rho):
    return lfilter([np.sqrt(1 - rho**2)], [1.0, -rho], rng.standard_normal(N + 500))[500:]


@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_the_interval_of_a_relative_error_covers_the_true_one(rho):
    rng, inside = np.random.default_rng(5), 0
    measured = regressor(rng)[:, 0]
    true = 0.1 * np.sqrt(N) / np.linalg.norm(measured)
    for _ in range(300):
        residual = 0.1 * coloured(rng, rho)
        error = np.linalg.norm(residual) / np.linalg.norm(measured)
        factor = relative_error_factor(measured, residual, [N // 2, N // 2])
        inside += error / factor <= true <= error * factor
    assert inside / 300 >= 0.93
    assert np.isnan(relative_error_factor(measured, 0.0 * residual, [N]))


def test_white_residuals_give_the_textbook_covariance():
    rng = np.random.default_rng(3)
    w, e = regressor(rng), rng.standard_normal(N)
    ours = np.sqrt(np.diag(sandwich_covariance(w, e, [N])))
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
        claimed.append(np.diag(sandwich_covariance(w, e - w @ step, [N])))
    real = np.std(errors, axis=0)
    assert np.sqrt(np.mean(claimed, axis=0)) == pytest.approx(real, rel=0.2)


def test_the_bootstrap_agrees_with_the_sandwich():
    rng = np.random.default_rng(5)
    w, e = regressor(rng), coloured(rng, 0.7)
    step = np.linalg.lstsq(w, e, rcond=None)[0]
    e = e - w @ step
    intervals = block_bootstrap(w, e, np.zeros(3), [N], rng=rng, repetitions=2000)
    half = 0.5 * (intervals[:, 1] - intervals[:, 0])
    assert half == pytest.approx(1.96 * np.sqrt(np.diag(sandwich_covariance(w, e, [N]))), rel=0.15)


def test_parameters_at_a_bound_do_not_spoil_the_others():
    rng = np.random.default_rng(6)
    w, e = regressor(rng), rng.standard_normal(N)
    free = np.array([True, True, False])
    covariance = sandwich_covariance(w, e, [N], free=free)
    assert covariance[2].tolist() == [0.0, 0.0, 0.0]
    assert covariance[:2, :2] == pytest.approx(sandwich_covariance(w[:, :2], e, [N]), rel=1e-6)


def test_stretches_are_independent():
    rng = np.random.default_rng(7)
    scores = coloured(rng, 0.9)[:, None]
    one, two = (long_run_covariance(scores, scores[:, 0], lengths) for lengths in ([N], [N // 2, N // 2]))
    assert two == pytest.approx(one, rel=0.2)


def test_whiteness_tells_white_from_coloured():
    rng = np.random.default_rng(8)
    white, colour = whiteness(rng.standard_normal(N), [N]), whiteness(coloured(rng, 0.9), [N])
    assert white.p_value > 0.01
    assert abs(white.lag1) < 0.06
    assert colour.p_value < 1e-6
    assert colour.lag1 == pytest.approx(0.9, abs=0.05)
    assert colour.effective_share < 0.2


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_the_correlation_time_is_that_of_an_autoregression(rho):
    residual = np.concatenate([coloured(np.random.default_rng(seed), rho) for seed in range(8)])
    assert correlation_time(residual, [N] * 8) == pytest.approx(0.5 * (1 + rho) / (1 - rho), rel=0.2)


@pytest.mark.parametrize("rho", [0.3, 0.9995])
def test_the_correlation_time_of_long_stretches_is_that_of_all_lags_at_once(rho, rng):
    lengths = [300_001, 65_536 + 1_024, 700, 0, 5]
    residual = lfilter([1.0], [1.0, -rho], rng.standard_normal(sum(lengths)))
    parts = np.split(residual - residual.mean(), np.cumsum(lengths)[:-1])
    total = sum(np.fft.irfft(np.abs(np.fft.rfft(part, 1 << 20)) ** 2) for part in parts)[: max(lengths)]
    sums = 0.5 + np.cumsum(total[1:] / total[0])
    expected = sums[np.argmax(np.arange(1, len(total)) >= 5.0 * sums)]
    assert correlation_time(residual, lengths) == pytest.approx(expected, rel=1e-12)


def test_what_alternates_has_no_memory():
    assert correlation_time(np.tile([1.0, -1.0], 50), [100]) == 0.5
    assert correlation_time(np.zeros(9), [9]) == 0.5


def test_a_few_blocks_are_always_left():
    slow = np.cumsum(np.random.default_rng(10).standard_normal(120))
    assert block_length(correlation_time(slow, [120]), 120) == 15


def test_other_columns_of_the_same_span_have_the_same_covariance():
    # A window for each score would not let what nearly equal columns share cancel.
    rng = np.random.default_rng(11)
    t = np.arange(N) / 50.0
    first = np.sign(np.sin(0.4 * t))
    w = np.stack([first, first + 0.02 * np.sin(3.0 * t)], axis=1)
    e = coloured(rng, 0.8) * (1.0 + 0.5 * np.sin(0.1 * t))
    e = e - w @ np.linalg.lstsq(w, e, rcond=None)[0]
    turn = np.array([[1.0, -1.0], [0.0, 50.0]])
    assert turn @ sandwich_covariance(w @ turn, e, [N]) @ turn.T == pytest.approx(
        sandwich_covariance(w, e, [N]), rel=1e-6
    )


def test_a_parameter_on_its_bound_lends_its_bias_to_no_interval():
    rng = np.random.default_rng(12)
    w, e = regressor(rng), rng.standard_normal(N)
    e = e - w @ np.linalg.lstsq(w, e, rcond=None)[0]
    # Held away from its best value, the last parameter leaves a mean in its scores.
    held = sandwich_covariance(w, e + 0.5 * w[:, 2], [N])
    assert held[2, 2] == pytest.approx(sandwich_covariance(w, e, [N])[2, 2], rel=0.3)


@pytest.mark.parametrize("freedom", [12.0, 20.0, 300.0])
def test_student_s_quantile_is_scipy_s(freedom):
    from scipy.special import ndtri, stdtrit

    assert student_to_normal_ratio(freedom) == pytest.approx(stdtrit(freedom, 0.975) / ndtri(0.975), rel=2e-6)


@pytest.mark.parametrize(
    "residual",
    [np.full(100, value) for value in (0.0, 1.0, np.nan, np.inf, 1e-300, 1e300)],
    ids=["zero", "constant", "nan", "infinite", "tiny", "huge"],
)
def test_every_residual_gets_an_answer(residual, rng):
    w = rng.standard_normal((100, 2))
    assert correlation_time(residual, [100]) == 0.5
    assert np.isnan(whiteness(residual, [100]).effective_share)
    assert sandwich_covariance(w, residual, [100]).shape == (2, 2)
    assert block_bootstrap(w, residual, np.zeros(2), [100], rng=rng, repetitions=20).shape == (2, 2)
    assert long_run_covariance(w * residual[:, None], residual, [100]).shape == (2, 2)


@pytest.mark.parametrize("rows", [np.zeros((100, 2)), np.ones((100, 2)), np.zeros((0, 2)), np.ones((1, 2))])
def test_parameters_that_rows_do_not_tell_apart_have_infinite_intervals(rows, rng):
    residual, lengths = np.ones(len(rows)), [len(rows)]
    covariance = sandwich_covariance(rows, residual, lengths)
    assert np.all(np.isinf(np.diag(covariance)))
    intervals = block_bootstrap(rows, residual, np.zeros(2), lengths, rng=rng, repetitions=20)
    assert np.array_equal(intervals, [[-np.inf, np.inf]] * 2)


def test_nothing_to_go_by_is_an_answer_too():
    assert correlation_time(np.zeros(0), []) == 0.5
    assert block_length(np.nan, 100) == block_length(0.5, 100)
    assert student_to_normal_ratio(0.0) == student_to_normal_ratio(np.nan) == np.inf
    assert np.array_equal(long_run_covariance(np.zeros((0, 2)), np.zeros(0), []), np.zeros((2, 2)))
    assert np.array_equal(
        sandwich_covariance(np.ones((5, 2)), np.ones(5), [5], free=np.zeros(2, bool)), np.zeros((2, 2))
    )
