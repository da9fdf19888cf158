r"""Estimate the time delay between effort and motion: the shift with the smallest regression residual.

.. math::
   \tau(t + d) = W(t)\,\beta + \rho, \qquad
   \partial\rho/\partial d = \tau'(t + d) \approx (W \beta)'

Gauss-Newton steps solve this for d. They use the slope of the modelled effort, because noise in the measured slope
would bias the estimate towards zero [1]_. The friction model influences the estimate: a friction sign that changes late
looks like a late effort. The delay is therefore estimated with several models, each richer than the last. The value is
that of the simplest model that agrees with the richest and explains the effort about as well. The confidence
interval covers those of all good models.

.. [1] T. Soderstrom, P. Stoica, "Instrumental variable methods for system identification", 1983.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .block_test import MIN_IMPROVEMENT
from .uncertainty import long_run_covariance


@dataclass(frozen=True)
class DelayThresholds:
    """Grid of delays, and thresholds above which one is believed."""

    max_delay_s: float = 0.2  # The search covers delays of at most this size in either direction [s]
    grid_count: int = 41  # Number of delays on the initial grid. Gauss-Newton steps start from the best of them.
    # A model contributes to the interval if its mean square residual is at most this multiple of the richest model's.
    max_comparable_residual_ratio: float = 1.5
    # A delay is corrected only if it differs from zero by at least this many standard errors.
    min_standard_errors: float = 4.0
    # A delay is accepted only if it explains at least this share of the residual's mean square. Friction errors imitate
    # delays of a few milliseconds, but explain less.
    min_explained_share: float = 0.15
    # A delay within a sampling period, such as that of an effort which is held from sample to sample, is corrected only
    # if it explains at least this share.
    min_explained_share_within_period: float = 0.5
    # A candidate delay is tried only if the effort is recorded during at least this share of the motion.
    min_recorded_share: float = 0.5
    # A lag replaces the delay only if its mean square residual is at most this share of the delay's.
    max_lag_residual_ratio: float = 0.8
    # An estimate is rejected if its mean square residual exceeds this multiple of the smallest one on the grid.
    max_grid_residual_ratio: float = 1.1


DELAY_THRESHOLDS = DelayThresholds()


LAG_TO_DELAY_RATIOS = np.geomspace(0.4, 4.0, 12)
"""Time constants of a first-order lag that are tried, divided by the estimated delay."""


@dataclass(frozen=True)
class DrivenRows:
    """Effort of one stretch, split into the part that may be late and the part that is not."""

    driven: np.ndarray  # effort that may be late, (n,)
    own: np.ndarray  # effort that acts without delay, (n,); subtracted
    fs: float  # sampling rate [Hz]
    kept: np.ndarray  # indices of the samples that enter the regression, (m,)

    def at(self, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the effort, shape (m,), advanced by `delay` [s], and which rows are recorded, (m,) bool."""
        place = self.kept + delay * self.fs
        inside = (place >= 1.0) & (place <= len(self.driven) - 3.0)
        return interpolate_cubic(self.driven, np.where(inside, place, 1.0)) - self.own[self.kept], inside


@dataclass(frozen=True)
class Columns:
    """A linear model in the rows of one stretch: intercept (m,), regressor (m, p), and the time derivatives of both."""

    intercept: np.ndarray
    regressor: np.ndarray
    intercept_slope: np.ndarray
    regressor_slope: np.ndarray

    @classmethod
    def of(cls, intercept: np.ndarray, regressor: np.ndarray, rows: DrivenRows) -> Columns:
        """Take the columns at the regression rows from full-rate arrays that were filtered like `rows`."""
        kept, period = rows.kept, 1.0 / rows.fs
        # The differences of `numpy.gradient`, in these rows alone.
        after, before = np.minimum(kept + 1, len(intercept) - 1), np.maximum(kept - 1, 0)
        span = (after - before) * period
        return cls(
            intercept[kept],
            regressor[kept],
            (intercept[after] - intercept[before]) / span,
            (regressor[after] - regressor[before]) / span[:, None],
        )


@dataclass(frozen=True)
class DelayFit:
    """The delay estimated with one model."""

    delay: float  # [s]
    error: float  # standard error of the delay [s]
    values: np.ndarray  # parameters of the model at this delay, (p,)
    before: float  # mean square residual without the delay
    after: float  # mean square residual with it


@dataclass(frozen=True)
class Delay:
    """Delay of the effort behind the motion, with its confidence interval."""

    value: float  # delay [s]
    error: float  # standard error [s]
    low: float  # lower end of the interval over all models that explain the effort about as well [s]
    high: float  # upper end of that interval [s]
    explained: float  # smallest share of the residual's mean square that the delay explains in any of those models
    sure: tuple[
        float, float
    ]  # interval of `DELAY_THRESHOLDS.min_standard_errors` standard errors over the same models [s]
    lag: bool = False  # whether `value` is the time constant of a first-order lag instead of a delay
    doubt: str = ""  # why it is not to be believed, in words; nothing is moved by a doubtful delay

    def beyond(self, other: float) -> float:
        """Return by how much the delay certainly exceeds `other`; negative if it is shorter, 0 if they may agree."""
        low, high = self.sure
        return max(low - other, 0.0) + min(high - other, 0.0)

    def clear(self, step: float) -> bool:
        """Return whether the delay is certain and explains more than friction errors, which imitate delays, could.

        One that may be within the drive's sampling period `step` [s] must explain more. A doubtful delay is never
        clear.
        """
        beyond, limits = abs(self.beyond(0.0)), DELAY_THRESHOLDS
        least = limits.min_explained_share if beyond > step else limits.min_explained_share_within_period
        return not self.doubt and beyond > 0.0 and self.explained >= least


def interpolate_cubic(samples: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Interpolate samples, shape (n,), at fractional indices, (m,), by cubics through four neighbours."""
    left = np.clip(np.floor(place).astype(int), 1, len(samples) - 3)
    x = place - left
    before, here, after, last = (samples[left + k] for k in (-1, 0, 1, 2))
    return (
        here * (1.0 - x * x) * (1.0 - 0.5 * x)
        + after * x * (1.0 + x) * (1.0 - 0.5 * x)
        - before * x * (1.0 - x) * (2.0 - x) / 6.0
        - last * x * (1.0 - x * x) / 6.0
    )


@dataclass(frozen=True)
class DelayGrid:
    """Efforts of all stretches at each delay of the initial grid, which the models share."""

    delays: np.ndarray  # (k,) [s]
    efforts: np.ndarray  # (m, k); 0 in rows that are not recorded
    inside: np.ndarray  # which rows are recorded, (m, k)

    @classmethod
    def of(cls, rows: Sequence[DrivenRows]) -> DelayGrid:
        """Return the efforts of all stretches."""
        delays = np.linspace(-DELAY_THRESHOLDS.max_delay_s, DELAY_THRESHOLDS.max_delay_s, DELAY_THRESHOLDS.grid_count)
        count = sum(len(r.kept) for r in rows)
        efforts, inside = np.empty((count, len(delays))), np.empty((count, len(delays)), bool)
        for i, delay in enumerate(delays):
            efforts[:, i], inside[:, i] = _efforts_at(rows, delay)
        return cls(delays, np.where(inside, efforts, 0.0), inside)

    def misfits(self, intercept: np.ndarray, basis: np.ndarray) -> np.ndarray:
        """Return the mean square residual at each delay, (k,), of a model with a `basis`, (m, r)."""
        left = np.where(self.inside, self.efforts - intercept[:, None], 0.0)
        left -= basis @ (basis.T @ left)
        return np.einsum("mk,mk,mk->k", left, left, self.inside) / np.maximum(self.inside.sum(axis=0), 1)


def _efforts_at(rows: Sequence[DrivenRows], delay: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the efforts of all stretches, (m,), advanced by a `delay` [s], and which rows are recorded, (m,)."""
    parts = [r.at(delay) for r in rows]
    return np.concatenate([y for y, _ in parts]), np.concatenate([inside for _, inside in parts])


def fit_delay(
    rows: Sequence[DrivenRows], grid: DelayGrid, model: Sequence[Columns], start: float | None = None
) -> DelayFit | None:
    """Estimate the delay with the smallest residual of one `model`; None if the data do not determine it.

    The search begins at `start` [s], or at the best delay of the `grid` of these rows.
    """
    intercept = np.concatenate([c.intercept for c in model])
    w = np.concatenate([c.regressor for c in model])
    scale = np.linalg.norm(w, axis=0)
    w = w[:, scale > 0.0] / scale[scale > 0.0]
    slopes = np.concatenate([c.regressor_slope for c in model])[:, scale > 0.0] / scale[scale > 0.0]
    intercept_slope = np.concatenate([c.intercept_slope for c in model])
    basis = _orthonormal_basis(w)

    def shifted(delay: float) -> tuple[np.ndarray, np.ndarray]:
        effort, inside = _efforts_at(rows, delay)
        return effort - intercept, inside

    left = grid.misfits(intercept, basis)
    # The middle of the grid is no delay.
    before, delay = float(left[len(left) // 2]), float(grid.delays[np.argmin(left)]) if start is None else start
    for _ in range(20):
        y, inside = shifted(delay)
        if inside.sum() < 2 * w.shape[1]:
            return None
        values = np.linalg.lstsq(w[inside], y[inside], rcond=1e-9)[0]
        residual = np.where(inside, y - w @ values, 0.0)
        slope = np.where(inside, intercept_slope + slopes @ values, 0.0)
        q = basis if inside.all() else _orthonormal_basis(w * inside[:, None])
        seen = slope - q @ (q.T @ slope)
        information = float(seen @ seen)
        if not information > 1e-6 * float(slope @ slope) > 0.0:
            return None
        step = -float(seen @ residual) / information
        delay += float(np.clip(step, -0.25 * DELAY_THRESHOLDS.max_delay_s, 0.25 * DELAY_THRESHOLDS.max_delay_s))
        if abs(delay) > 1.5 * DELAY_THRESHOLDS.max_delay_s:
            return None
        if abs(step) < 1e-7:
            break
    after = float(np.mean(residual[inside] ** 2))
    if after > DELAY_THRESHOLDS.max_grid_residual_ratio * left.min():
        return None  # the steps did not reach the smallest residual, because of noise
    freed = len(residual) / max(len(residual) - w.shape[1] - 1, 1)
    spread = long_run_covariance((seen * residual)[:, None], residual, [len(r.kept) for r in rows])
    error = float(np.sqrt(freed * spread[0, 0])) / information
    whole = np.zeros(len(scale))
    whole[scale > 0.0] = values / scale[scale > 0.0]
    return DelayFit(delay, error, whole, before, after)


def combine_models(fits: Sequence[DelayFit], quantile: float, step: float) -> Delay:
    """Combine the estimates of several models, the simplest first, into one delay with an interval.

    The value is that of the simplest model that agrees with the richest within a sampling period `step` [s], and whose
    error the richest improves by at most `MIN_IMPROVEMENT`: it confuses friction with a delay the least. The interval
    covers every model that agrees or fits about as well, each with `quantile` standard errors. Half a period is added
    at either end: the drive may be read at any time within it.
    """
    last = fits[-1]
    most = last.after / (1.0 - MIN_IMPROVEMENT) ** 2
    first = next((f for f in fits if abs(f.delay - last.delay) <= step and f.after <= most), last)
    good = [
        f
        for f in fits
        if f.after <= DELAY_THRESHOLDS.max_comparable_residual_ratio * last.after or abs(f.delay - last.delay) <= step
    ]

    def reach(errors: float) -> tuple[float, float]:
        return min(f.delay - errors * f.error for f in good), max(f.delay + errors * f.error for f in good)

    low, high = reach(quantile)
    within = low - 0.5 * step, high + 0.5 * step
    explained = min(1.0 - f.after / f.before if f.before > 0.0 else 0.0 for f in good)
    return Delay(first.delay, first.error, *within, explained, reach(DELAY_THRESHOLDS.min_standard_errors))


def _orthonormal_basis(w: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis, shape (m, r), of the span of the columns of `w`, (m, p)."""
    left, singular, _ = np.linalg.svd(w, full_matrices=False)
    return left[:, singular > 1e-9 * singular[0]]


def find_likely_delays(
    w: np.ndarray, effort: Callable[[np.ndarray], np.ndarray], times: np.ndarray, tried: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the delays among `tried` [s] with a locally smallest residual, the best first, and their residual shares.

    `w` is a regressor, (m, p), at `times`, (m,) [s]. `effort` maps times to efforts, NaN where none is recorded.
    """
    q = _orthonormal_basis(w / np.maximum(np.linalg.norm(w, axis=0), np.finfo(float).tiny))
    left = np.full(len(tried), np.inf)
    for i, delay in enumerate(tried):
        y = effort(times + delay)
        inside = np.isfinite(y)
        if inside.mean() < DELAY_THRESHOLDS.min_recorded_share:
            continue
        y, basis = y[inside], q if inside.all() else _orthonormal_basis(q[inside])
        off = y - basis @ (basis.T @ y)
        spread = y - y.mean()
        left[i] = float(off @ off) / max(float(spread @ spread), np.finfo(float).tiny)
    beside = np.pad(left, 1, constant_values=np.inf)
    lowest = np.flatnonzero((left <= beside[:-2]) & (left <= beside[2:]) & np.isfinite(left))
    lowest = lowest[np.argsort(left[lowest], kind="stable")]
    return tried[lowest], left[lowest]


def prefer_better_lag(
    delay: Delay, after: float, rows: Sequence[DrivenRows], whole: Sequence[np.ndarray], step: float
) -> Delay:
    """Return a first-order lag of the effort if it fits clearly better than the `delay`; the `delay` otherwise.

    `after` is the delay's mean square residual. `whole` has the intercept and the regressor of each stretch at full
    rate, (n, 1 + p). `step` is the sampling period [s].
    """
    if delay.value <= 0.0:
        return delay
    y = np.concatenate([r.driven[r.kept] for r in rows])

    def lagged(time: float) -> np.ndarray:
        parts = []
        for r, columns in zip(rows, whole, strict=True):
            moving = columns.copy()
            moving[:, 0] += r.own
            parts.append(apply_first_order_lag(moving, time * r.fs)[r.kept])
        return np.concatenate(parts)

    def fitted(time: float) -> tuple[float, np.ndarray, np.ndarray]:
        columns = lagged(time)
        q = _orthonormal_basis(
            columns[:, 1:] / np.maximum(np.linalg.norm(columns[:, 1:], axis=0), np.finfo(float).tiny)
        )
        off = y - columns[:, 0]
        modelled = q @ (q.T @ off)
        return float(np.mean((off - modelled) ** 2)), off - modelled, columns[:, 0] + modelled

    tried = delay.value * LAG_TO_DELAY_RATIOS
    left = np.array([fitted(time)[0] for time in tried])
    time = float(tried[np.argmin(left)])
    if time in (tried[0], tried[-1]):
        return delay
    for share in (LAG_TO_DELAY_RATIOS[1] / LAG_TO_DELAY_RATIOS[0], 1.03, 1.03):
        # The minimum of the parabola through this point and both neighbours, over the logarithm, refines it.
        a, b, c = (fitted(time * share**k)[0] for k in (-1, 0, 1))
        time *= float(share ** np.clip(0.5 * (a - c) / (a - 2.0 * b + c), -1.0, 1.0))
    less, residual, _ = fitted(time)
    if less > DELAY_THRESHOLDS.max_lag_residual_ratio * after:
        return delay
    columns = lagged(time)
    values = np.linalg.lstsq(columns[:, 1:], y - columns[:, 0], rcond=1e-9)[0]
    more = lagged(1.01 * time)
    slope = ((more[:, 0] - columns[:, 0]) + (more[:, 1:] - columns[:, 1:]) @ values) / (0.01 * time)
    q = _orthonormal_basis(columns[:, 1:] / np.maximum(np.linalg.norm(columns[:, 1:], axis=0), np.finfo(float).tiny))
    seen = slope - q @ (q.T @ slope)
    spread = long_run_covariance((seen * residual)[:, None], residual, [len(r.kept) for r in rows])
    error = float(np.sqrt(spread[0, 0])) / float(seen @ seen)
    before, reach = (
        left[0] if delay.explained <= 0.0 else after / (1.0 - delay.explained),
        1.959964 * error + 0.5 * step,
    )
    sure = time - DELAY_THRESHOLDS.min_standard_errors * error, time + DELAY_THRESHOLDS.min_standard_errors * error
    return Delay(time, error, time - reach, time + reach, 1.0 - less / before, sure, lag=True)


def apply_first_order_lag(columns: np.ndarray, samples: float) -> np.ndarray:
    """Pass `columns`, (n, k), through a first-order lag with a time constant in `samples`, settled at the start."""
    n = len(columns)
    padded = n + int(np.ceil(20.0 * samples))
    spectrum = np.fft.rfft(columns - columns[0], padded, axis=0)
    turns = 2.0 * np.pi * np.fft.rfftfreq(padded) * samples
    return np.fft.irfft(spectrum / (1.0 + 1j * turns)[:, None], padded, axis=0)[:n] + columns[0]
