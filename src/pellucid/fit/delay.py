r"""How late one side of a regression is: the shift of the effort that leaves the smallest residual, with an interval.

.. math::
   \tau(t + d) = W(t)\,\beta + \rho, \qquad
   \partial\rho/\partial d = \tau'(t + d) \approx (W \beta)'

solved by Gauss-Newton steps in which the modelled effort's slope stands for the measured one's, whose noise would bias
the estimate towards zero [1]_. What friction is taken for moves the answer: a sign that changes late looks like a late
effort. So the delay is estimated with several models, each richer than the last; the richest gives the value, and the
interval reaches over all of theirs.

.. [1] T. Soderstrom, P. Stoica, "Instrumental variable methods for system identification", 1983.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .uncertainty import long_run_covariance

REACH = 0.2
"""Delays are looked for up to here [s]."""

STARTS = 41
"""Delays that are tried before steps are taken from the best of them."""

AS_GOOD = 1.5
"""A model counts that leaves at most so many times what the richest leaves, in mean square."""

SURE = 4.0
"""Standard errors by which a delay must be off zero before anything is moved on its account."""

WORTH = 0.15
"""Share of the residual's mean square that a delay explains before it is one: what friction models lack looks like one
of some milliseconds, and explains less."""

LEAST_SEEN = 0.5
"""Share of a motion during which an effort must be recorded for a delay to be tried."""

LAGS = np.geomspace(0.4, 4.0, 12)
"""Time constants of a lag that are tried, as shares of the delay that is most like it."""

SMOOTHER = 0.8
"""A lag leaves at most so much of what a delay leaves, in mean square, before it is taken for one."""

ALIKE = 1.1
"""By how much the residual's mean square may exceed the smallest of those tried."""


@dataclass(frozen=True)
class DrivenRows:
    """One stretch: the effort that may be late, (n,), what is not, (n,), at a rate `fs` [Hz], and which samples, (m,),
    enter a regression."""

    driven: np.ndarray
    own: np.ndarray
    fs: float
    kept: np.ndarray

    def at(self, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """The effort, (m,), had it come `delay` [s] earlier, and which rows, (m,) bool, are recorded."""
        place = self.kept + delay * self.fs
        inside = (place >= 1.0) & (place <= len(self.driven) - 3.0)
        return between(self.driven, np.where(inside, place, 1.0)) - self.own[self.kept], inside


@dataclass(frozen=True)
class Columns:
    """A model linear in its free values: intercept (n,), regressor (n, p) of one stretch and the slopes of both, where
    rows are taken."""

    intercept: np.ndarray
    regressor: np.ndarray
    intercept_slope: np.ndarray
    regressor_slope: np.ndarray

    @classmethod
    def of(cls, intercept: np.ndarray, regressor: np.ndarray, rows: DrivenRows) -> Columns:
        """The same from full-rate arrays, filtered as `rows` were."""
        slopes = (np.gradient(x, 1.0 / rows.fs, axis=0)[rows.kept] for x in (intercept, regressor))
        return cls(intercept[rows.kept], regressor[rows.kept], *slopes)


@dataclass(frozen=True)
class DelayFit:
    """The delay that one model gives [s], its standard error, the model's values, (p,), and residuals' mean square
    without the delay and with it."""

    delay: float
    error: float
    values: np.ndarray
    before: float
    after: float


@dataclass(frozen=True)
class Delay:
    """How much later the effort is than the motion, and how sure that is."""

    value: float  # [s]
    error: float  # Its standard error [s]
    low: float  # low, high: What holds the delay by every model that explains the effort about as well [s]
    high: float
    explained: float  # Least share of the residual's mean square that it explains, of those models
    sure: tuple[float, float]  # What holds it where those intervals are `SURE` standard errors wide [s]
    lag: bool = False  # Whether it is a first-order lag, whose time constant these are

    def beyond(self, other: float) -> float:
        """By how much it is certainly longer than an `other`, negative where it is shorter; 0 where it may be that."""
        low, high = self.sure
        return max(low - other, 0.0) + min(high - other, 0.0)

    def clear(self, step: float) -> bool:
        """Whether it is more than a drive's sampling, every `step` [s], or what friction is taken for would make."""
        return abs(self.beyond(0.0)) > step and self.explained >= WORTH


def between(samples: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Samples, (n,), at fractional places, (m,), by cubics through four neighbours."""
    left = np.clip(np.floor(place).astype(int), 1, len(samples) - 3)
    x = place - left
    before, here, after, last = (samples[left + k] for k in (-1, 0, 1, 2))
    return (
        here * (1.0 - x * x) * (1.0 - 0.5 * x)
        + after * x * (1.0 + x) * (1.0 - 0.5 * x)
        - before * x * (1.0 - x) * (2.0 - x) / 6.0
        - last * x * (1.0 - x * x) / 6.0
    )


def fit_delay(rows: Sequence[DrivenRows], model: Sequence[Columns], start: float | None = None) -> DelayFit | None:
    """The delay at which one `model` leaves the smallest residual, from a `start` [s] or the best of a grid; None where
    nothing shows it."""
    intercept = np.concatenate([c.intercept for c in model])
    w = np.concatenate([c.regressor for c in model])
    scale = np.linalg.norm(w, axis=0)
    w = w[:, scale > 0.0] / scale[scale > 0.0]
    slopes = np.concatenate([c.regressor_slope for c in model])[:, scale > 0.0] / scale[scale > 0.0]
    intercept_slope = np.concatenate([c.intercept_slope for c in model])
    basis = _basis(w)

    def shifted(delay: float) -> tuple[np.ndarray, np.ndarray]:
        parts = [r.at(delay) for r in rows]
        return np.concatenate([y for y, _ in parts]) - intercept, np.concatenate([inside for _, inside in parts])

    def misfit(delay: float) -> float:
        y, inside = shifted(delay)
        y, q = y[inside], basis[inside]
        return float(np.sum((y - q @ (q.T @ y)) ** 2) / max(inside.sum(), 1))

    tried = np.linspace(-REACH, REACH, STARTS)
    left = np.array([misfit(d) for d in tried])
    before, delay = misfit(0.0), float(tried[np.argmin(left)]) if start is None else start
    for _ in range(20):
        y, inside = shifted(delay)
        if inside.sum() < 2 * w.shape[1]:
            return None
        values = np.linalg.lstsq(w[inside], y[inside], rcond=1e-9)[0]
        residual = np.where(inside, y - w @ values, 0.0)
        slope = np.where(inside, intercept_slope + slopes @ values, 0.0)
        q = basis if inside.all() else _basis(w * inside[:, None])
        seen = slope - q @ (q.T @ slope)
        information = float(seen @ seen)
        if not information > 1e-6 * float(slope @ slope) > 0.0:
            return None
        step = -float(seen @ residual) / information
        delay += float(np.clip(step, -0.25 * REACH, 0.25 * REACH))
        if abs(delay) > 1.5 * REACH:
            return None
        if abs(step) < 1e-7:
            break
    after = float(np.mean(residual[inside] ** 2))
    if after > ALIKE * min(left.min(), before):
        return None  # noise moved the steps elsewhere than to the smallest residual
    freed = len(residual) / max(len(residual) - w.shape[1] - 1, 1)
    spread = long_run_covariance((seen * residual)[:, None], residual, [len(r.kept) for r in rows])
    error = float(np.sqrt(freed * spread[0, 0])) / information
    whole = np.zeros(len(scale))
    whole[scale > 0.0] = values / scale[scale > 0.0]
    return DelayFit(delay, error, whole, before, after)


def over_models(fits: Sequence[DelayFit], quantile: float, step: float) -> Delay:
    """The delay of the simplest model that agrees with the richest within a sampling `step` [s]: finer than that they
    cannot be told apart, and it confuses a delay with the least. The interval holds the delays of all that agree or
    leave about as little residual, each `quantile` standard errors wide, and half a step at either end: when in a step
    a drive is read is not known."""
    last = fits[-1]
    first = next(f for f in fits if abs(f.delay - last.delay) <= step)
    good = [f for f in fits if f.after <= AS_GOOD * last.after or abs(f.delay - last.delay) <= step]

    def reach(errors: float) -> tuple[float, float]:
        return min(f.delay - errors * f.error for f in good), max(f.delay + errors * f.error for f in good)

    low, high = reach(quantile)
    within = low - 0.5 * step, high + 0.5 * step
    explained = min(1.0 - f.after / f.before if f.before > 0.0 else 0.0 for f in good)
    return Delay(first.delay, first.error, *within, explained, reach(SURE))


def _basis(w: np.ndarray) -> np.ndarray:
    """An orthonormal basis, (m, r), of the columns of `w`, (m, p), proportional ones once."""
    left, singular, _ = np.linalg.svd(w, full_matrices=False)
    return left[:, singular > 1e-9 * singular[0]]


def likeliest(
    w: np.ndarray, effort: Callable[[np.ndarray], np.ndarray], times: np.ndarray, tried: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Those of the delays `tried` [s] at which a regressor, (m, p), at `times`, (m,) [s], leaves less of an effort, NaN
    where it is not recorded, unexplained than at their neighbours, the least first; and which share they leave."""
    q = _basis(w / np.maximum(np.linalg.norm(w, axis=0), np.finfo(float).tiny))
    left = np.full(len(tried), np.inf)
    for i, delay in enumerate(tried):
        y = effort(times + delay)
        inside = np.isfinite(y)
        if inside.mean() < LEAST_SEEN:
            continue
        y, basis = y[inside], q if inside.all() else _basis(q[inside])
        off = y - basis @ (basis.T @ y)
        spread = y - y.mean()
        left[i] = float(off @ off) / max(float(spread @ spread), np.finfo(float).tiny)
    beside = np.pad(left, 1, constant_values=np.inf)
    lowest = np.flatnonzero((left <= beside[:-2]) & (left <= beside[2:]) & np.isfinite(left))
    lowest = lowest[np.argsort(left[lowest], kind="stable")]
    return tried[lowest], left[lowest]


def lag_instead(
    delay: Delay, after: float, rows: Sequence[DrivenRows], whole: Sequence[np.ndarray], step: float
) -> Delay:
    """The `delay`, or a first-order lag of the effort in its place where that leaves clearly less than `after`, in mean
    square. `whole`: of each stretch the intercept and the regressor at full rate, (n, 1 + p); `step` [s]."""
    if delay.value <= 0.0:
        return delay
    y = np.concatenate([r.driven[r.kept] for r in rows])

    def lagged(time: float) -> np.ndarray:
        parts = []
        for r, columns in zip(rows, whole, strict=True):
            moving = columns.copy()
            moving[:, 0] += r.own
            parts.append(first_order(moving, time * r.fs)[r.kept])
        return np.concatenate(parts)

    def fitted(time: float) -> tuple[float, np.ndarray, np.ndarray]:
        columns = lagged(time)
        q = _basis(columns[:, 1:] / np.maximum(np.linalg.norm(columns[:, 1:], axis=0), np.finfo(float).tiny))
        off = y - columns[:, 0]
        modelled = q @ (q.T @ off)
        return float(np.mean((off - modelled) ** 2)), off - modelled, columns[:, 0] + modelled

    tried = delay.value * LAGS
    left = np.array([fitted(time)[0] for time in tried])
    time = float(tried[np.argmin(left)])
    if time in (tried[0], tried[-1]):
        return delay
    for share in (LAGS[1] / LAGS[0], 1.03, 1.03):
        # The parabola through it and both neighbours, over the logarithm.
        a, b, c = (fitted(time * share**k)[0] for k in (-1, 0, 1))
        time *= float(share ** np.clip(0.5 * (a - c) / (a - 2.0 * b + c), -1.0, 1.0))
    less, residual, _ = fitted(time)
    if less > SMOOTHER * after:
        return delay
    columns = lagged(time)
    values = np.linalg.lstsq(columns[:, 1:], y - columns[:, 0], rcond=1e-9)[0]
    more = lagged(1.01 * time)
    slope = ((more[:, 0] - columns[:, 0]) + (more[:, 1:] - columns[:, 1:]) @ values) / (0.01 * time)
    q = _basis(columns[:, 1:] / np.maximum(np.linalg.norm(columns[:, 1:], axis=0), np.finfo(float).tiny))
    seen = slope - q @ (q.T @ slope)
    spread = long_run_covariance((seen * residual)[:, None], residual, [len(r.kept) for r in rows])
    error = float(np.sqrt(spread[0, 0])) / float(seen @ seen)
    before, reach = (
        left[0] if delay.explained <= 0.0 else after / (1.0 - delay.explained),
        1.959964 * error + 0.5 * step,
    )
    sure = time - SURE * error, time + SURE * error
    return Delay(time, error, time - reach, time + reach, 1.0 - less / before, sure, lag=True)


def first_order(columns: np.ndarray, samples: float) -> np.ndarray:
    """`columns`, (n, k), behind a first-order lag of so many `samples`, settled at the start."""
    n = len(columns)
    padded = n + int(np.ceil(20.0 * samples))
    spectrum = np.fft.rfft(columns - columns[0], padded, axis=0)
    turns = 2.0 * np.pi * np.fft.rfftfreq(padded) * samples
    return np.fft.irfft(spectrum / (1.0 + 1j * turns)[:, None], padded, axis=0)[:n] + columns[0]
