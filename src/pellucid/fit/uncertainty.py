r"""How sure an estimate is: covariances that allow for coloured residuals, block bootstrap, whiteness.

With scores :math:`s_t = z_t \rho_t`, the covariance of an estimate is

.. math::
   C = (Z^T W)^{-1} \, S \, (W^T Z)^{-1}, \qquad S = \sum_{t,u} E[s_t s_u^T]

where Z = W for least squares. S is estimated by a quadratic-spectral kernel with prewhitened scores and an automatic
bandwidth [1]_, [2]_; for white residuals it reduces to the textbook :math:`\sigma^2 (W^T W)^{-1}`.

.. [1] D. W. K. Andrews, "Heteroskedasticity and autocorrelation consistent covariance matrix estimation",
   Econometrica 59, 1991.
.. [2] D. W. K. Andrews, J. C. Monahan, "An improved heteroskedasticity and autocorrelation consistent covariance
   matrix estimator", Econometrica 60, 1992.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .parameter import Whiteness

PREWHITENING_LIMIT = 0.97


def long_run_covariance(scores: np.ndarray, lengths: Sequence[int]) -> np.ndarray:
    """Sum of all autocovariances of the scores, times their number. `scores` (m, p); gives (p, p)."""
    ends = np.cumsum(lengths)
    parts = [scores[e - n : e] for e, n in zip(ends, lengths, strict=True) if n > 8]
    before = np.concatenate([p[:-1] for p in parts])
    after = np.concatenate([p[1:] for p in parts])
    # One lag per score: a full vector autoregression has p^2 coefficients and gains nothing here.
    rho = np.sum(before * after, axis=0) / np.maximum(np.sum(before**2, axis=0), np.finfo(float).tiny)
    rho = np.clip(rho, -PREWHITENING_LIMIT, PREWHITENING_LIMIT)
    white = [p[1:] - rho * p[:-1] for p in parts]
    bandwidth = _bandwidth(white)
    longest = max(len(p) for p in white)
    reach = min(longest - 1, int(np.ceil(12.0 * bandwidth)) + 1)
    total = sum(p.T @ p for p in white)
    for lag in range(1, reach + 1):
        weight = _quadratic_spectral(lag / bandwidth)
        gamma = sum(p[lag:].T @ p[:-lag] for p in white if len(p) > lag)
        total = total + weight * (gamma + gamma.T)
    recolour = 1.0 / (1.0 - rho)
    count = sum(len(p) for p in white)
    return total * np.outer(recolour, recolour) * (len(scores) / count)


def _bandwidth(white: list[np.ndarray]) -> float:
    """Andrews' automatic bandwidth from first-order autoregressions of each (standardised) score."""
    before = np.concatenate([p[:-1] for p in white])
    after = np.concatenate([p[1:] for p in white])
    power = np.maximum(np.sum(before**2, axis=0), np.finfo(float).tiny)
    rho = np.clip(np.sum(before * after, axis=0) / power, -PREWHITENING_LIMIT, PREWHITENING_LIMIT)
    # Each score weighs the same, whatever its unit.
    alpha = np.sum(4.0 * rho**2 / (1.0 - rho) ** 8) / np.sum(1.0 / (1.0 - rho) ** 4)
    return float(max(1.3221 * (alpha * len(before)) ** 0.2, 1.0))


def _quadratic_spectral(x: float) -> float:
    z = 6.0 * np.pi * x / 5.0
    return float(25.0 / (12.0 * np.pi**2 * x**2) * (np.sin(z) / z - np.cos(z)))


def sandwich(
    jacobian: np.ndarray,
    residual: np.ndarray,
    lengths: Sequence[int],
    instruments: np.ndarray | None = None,
    free: np.ndarray | None = None,
) -> np.ndarray:
    """Covariance of an estimate that solves Z^T rho = 0. `jacobian` (m, p); `residual` (m,); `instruments` (m, p);
    `free` (p,); gives (p, p)."""
    p = jacobian.shape[1]
    free = np.ones(p, bool) if free is None else free
    w = jacobian[:, free]
    z = w if instruments is None else instruments[:, free]
    scale = np.linalg.norm(w, axis=0)
    bread = np.linalg.inv((z / scale).T @ (w / scale))
    meat = long_run_covariance((z / scale) * residual[:, None], lengths)
    correction = len(residual) / max(len(residual) - int(free.sum()), 1)
    covariance = np.zeros((p, p))
    covariance[np.ix_(free, free)] = correction * (bread @ meat @ bread.T) / np.outer(scale, scale)
    return covariance


def block_bootstrap(
    jacobian: np.ndarray,
    residual: np.ndarray,
    values: np.ndarray,
    *,
    block: int,
    rng: np.random.Generator,
    repetitions: int = 400,
    level: float = 0.95,
) -> np.ndarray:
    """Percentile intervals from resampled blocks of rows, on the model linearised at the solution. `jacobian` (m,
    p); `residual` (m,); `values` (p,); gives (p, 2)."""
    scale = np.linalg.norm(jacobian, axis=0)
    w = jacobian / scale
    starts = np.arange(0, len(w) - block + 1, max(1, block // 2))
    gram = np.stack([w[s : s + block].T @ w[s : s + block] for s in starts])
    moment = np.stack([w[s : s + block].T @ residual[s : s + block] for s in starts])
    draws = rng.integers(0, len(starts), size=(repetitions, max(1, round(len(w) / block))))
    steps = np.array([np.linalg.lstsq(gram[d].sum(axis=0), moment[d].sum(axis=0), rcond=None)[0] for d in draws])
    tail = 50.0 * (1.0 - level)
    return values[:, None] + (np.percentile(steps, [tail, 100.0 - tail], axis=0) / scale).T


def decorrelation_lag(residual: np.ndarray) -> int:
    """Samples until the residual's autocorrelation first falls below 2 standard errors."""
    centred = residual - residual.mean()
    n = len(centred)
    spectrum = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n] / max(spectrum.mean(), np.finfo(float).tiny)
    correlation = correlation / max(correlation[0], np.finfo(float).tiny)
    below = np.flatnonzero(correlation[: n // 4] < 2.0 / np.sqrt(n))
    return int(below[0]) if len(below) else n // 4


def whiteness(residual: np.ndarray, lengths: Sequence[int], lags: int = 20) -> Whiteness:
    """Ljung-Box test of the residual, pooled over stretches. `residual` (m,)."""
    from scipy.special import chdtrc

    ends = np.cumsum(lengths)
    parts = [residual[e - n : e] for e, n in zip(ends, lengths, strict=True) if n > lags + 1]
    if not parts:
        return Whiteness(float("nan"), float("nan"), float("nan"), lags, float("nan"))
    mean = np.mean(np.concatenate(parts))
    parts = [p - mean for p in parts]
    power = sum(float(p @ p) for p in parts)
    n = sum(len(p) for p in parts)
    rho = np.array([sum(float(p[k:] @ p[:-k]) for p in parts) / power for k in range(1, lags + 1)])
    statistic = float(n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, lags + 1))))
    # Up to the first lag that is not positive: beyond it sample correlations are mostly noise.
    positive = rho[: int(np.argmax(rho <= 0.0))] if np.any(rho <= 0.0) else rho
    share = float(1.0 / (1.0 + 2.0 * positive.sum()))
    return Whiteness(float(rho[0]), statistic, float(chdtrc(lags, statistic)), lags, share)
