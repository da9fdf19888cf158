r"""Uncertainty of estimates: covariances that allow for coloured residuals, block bootstrap, whiteness.

With scores :math:`s_t = z_t \rho_t`, the covariance of an estimate is

.. math::
   C = (Z^T W)^{-1} \, S \, (W^T Z)^{-1}, \qquad S = \sum_{t,u} E[s_t s_u^T]

where Z = W for least squares. One prewhitening filter for all scores removes most of their autocorrelation [4]_. The
rest is estimated from sums over all overlapping blocks of b neighbours [1]_, the limit of a moving-block bootstrap
[2]_:

.. math::
   u_t = s_t - \bar s - r (s_{t-1} - \bar s), \qquad B_t = \sum_{i=t}^{t+b-1} u_i, \qquad
   S = \frac{k^2}{(1 - r)^2 (1 - b/m)} \, \frac{1}{b} \sum_t B_t B_t^T

b is ten correlation times [3]_ of the residual. r = tr(G_0^{-1} G_1)/p, with G_0 and G_1 the scores' autocovariances at
lags 0 and 1, does not depend on the parameters' units or combinations. A separate filter or window for each score would
prevent the common part of nearly equal columns from cancelling. Scores sum to zero, so the variance between blocks
lacks a share b/m. The factor k is Student's quantile for 1.5 m/b degrees of freedom over the normal one, and allows for
the small number of blocks. Blocks never reach across two stretches. For white residuals S tends to the textbook value.

Every function here accepts any input. A residual that is zero or not finite counts as white for the block length and
gives no test of whiteness. Parameters that the rows cannot tell apart have infinite variances and intervals.

How far a signal remembers itself: coloured misfit counts as fewer samples than it has.

.. [1] M. S. Meketon, B. Schmeiser, "Overlapping batch means: something for nothing?", Proc. Winter Simulation
   Conference, 1984.
.. [2] H. R. Kuensch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17, 1989.
.. [3] A. Sokal, "Monte Carlo methods in statistical mechanics: foundations and new algorithms", 1997: the window of an
   integrated correlation time.
.. [4] D. W. K. Andrews, J. C. Monahan, "An improved heteroskedasticity and autocorrelation consistent covariance
   matrix estimator", Econometrica 60, 1992.
.. [5] M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 1964, 26.7.5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..models.estimates import Whiteness
from .distributions import chi_square_tail
from .regression import column_norms, some_columns


@dataclass(frozen=True)
class BlockSettings:
    """Sizes of the blocks from which covariances and bootstraps are made."""

    block_correlation_times: int = 10  # Length of a block in correlation times
    # Smallest number of blocks into which the rows are divided. Fewer blocks do not show their spread.
    min_blocks: int = 8
    # Largest size of r. Beyond it the filter leaves little to measure and multiplies it by more than 25.
    max_prewhitening_coefficient: float = 0.8
    # Autocorrelations are summed over lags of up to this many correlation times [3]_.
    max_lag_correlation_times: float = 5.0
    # Largest number of blocks in a bootstrap. Longer recordings get longer blocks, which are as informative.
    max_bootstrap_blocks: int = 500
    # So many lags are summed at first, a power of two; more only where autocorrelations last longer.
    first_lag_count: int = 1 << 10
    block_starts_per_length: int = 16  # Number of overlapping blocks that begin within the length of one block
    # So many scores are made at once, for one parameter or more.
    max_scores_at_once: int = 1 << 19
    # So many blocks are drawn by one call of NumPy; more would not fit into the processor's cache.
    max_blocks_drawn_at_once: int = 10_000


BLOCK_SETTINGS = BlockSettings()


NORMAL_QUANTILE_975 = 1.959963984540054
"""97.5 % quantile of the standard normal distribution."""

STUDENT_EXPANSION = (
    ({9: 79.0, 7: 776.0, 5: 1482.0, 3: -1920.0, 1: -945.0}, 92160.0),
    ({7: 3.0, 5: 19.0, 3: 17.0, 1: -15.0}, 384.0),
    ({5: 5.0, 3: 16.0, 1: 3.0}, 96.0),
    ({3: 1.0, 1: 1.0}, 4.0),
)
"""Fisher's expansion of Student's quantile, the last term first. Each term has a polynomial in the normal quantile, as
coefficients by power, and a divisor."""


def _stretches(lengths: Sequence[int]) -> Iterator[slice]:
    """Yield the rows of each stretch."""
    end = 0
    for n in lengths:
        yield slice(end, end + n)
        end += n


ROWS_AT_ONCE = 1 << 16
"""Number of rows whose products are summed at a time, so that no copy of all rows is made."""


@np.errstate(over="ignore", invalid="ignore")
def correlation_time(residual: np.ndarray, lengths: Sequence[int]) -> float:
    """Return the correlation time of a residual, (m,), in samples.

    It is half the sum of the autocorrelations over lags of either sign, up to five correlation times. It is 1/2 for
    white and for alternating residuals, and for residuals that are empty or not finite.
    """
    if not len(residual) or not np.isfinite(residual).all():
        return 0.5
    centred = residual - np.mean(residual)
    most, count = max(lengths), BLOCK_SETTINGS.first_lag_count
    while True:
        total = np.zeros(min(count, most))
        for rows in _stretches(lengths):
            products = _lagged_products(centred[rows], len(total))
            total[: len(products)] += products
        if not total[0] > 0.0:
            return 0.5
        sums = 0.5 + np.cumsum(total[1:] / total[0])
        enough = np.flatnonzero(np.arange(1, len(total)) >= BLOCK_SETTINGS.max_lag_correlation_times * sums)
        if len(enough) or count >= most:
            return float(max(0.5, sums[enough[0]] if len(enough) else sums[-1])) if len(sums) else 0.5
        count *= 8


def _lagged_products(samples: np.ndarray, count: int) -> np.ndarray:
    """Return the sum of the products of `samples`, (n,), with those k later, for each k below `count` and n."""
    n = len(samples)
    if n <= 4 * count:
        padded = 1 << (2 * n - 1).bit_length() if n else 2  # a power of two is transformed fastest
        return np.fft.irfft(np.abs(np.fft.rfft(samples, padded)) ** 2)[: min(n, count)]
    # Parts of `count` samples, each with the one after it, which reaches as far as the lags do. They fit the cache.
    later, total = np.where(np.arange(count + 1) % 2, -1.0, 1.0), np.zeros(count + 1, complex)
    step = max(ROWS_AT_ONCE, count)
    for first in range(0, n, step):
        some = samples[first : first + step + count]
        parts = np.zeros((-(-min(n - first, step) // count) + 1, 2 * count))
        whole, left = divmod(len(some), count)
        parts[:whole, :count] = some[: whole * count].reshape(whole, count)
        parts[whole : whole + 1, :left] = some[whole * count :]
        spectra = np.fft.rfft(parts)
        total += np.einsum("ij,ij->j", spectra[:-1].conj(), spectra[:-1] + later * spectra[1:])
    return np.fft.irfft(total)[:count]


def block_length(time: float, rows: int) -> int:
    """Return the number of rows in a block: ten correlation times, or less if there would be too few blocks.

    A correlation time that is not finite counts as that of white noise.
    """
    time = time if np.isfinite(time) else 0.5
    return int(
        np.clip(round(BLOCK_SETTINGS.block_correlation_times * time), 1, max(1, rows // BLOCK_SETTINGS.min_blocks))
    )


@np.errstate(over="ignore", invalid="ignore")
def long_run_covariance(
    scores: np.ndarray, residual: np.ndarray, lengths: Sequence[int], memory: float | None = None
) -> np.ndarray:
    """Return the sum of all autocovariances of `scores`, (m, p), times their number, shape (p, p).

    The blocks' length follows from the correlation time of `residual`, (m,), or from `memory`, a known correlation time
    in samples.
    """
    m, p = scores.shape
    if m == 0 or p == 0:
        return np.zeros((p, p))
    if not np.isfinite(scores).all():
        return np.full((p, p), np.nan)
    block = block_length(correlation_time(residual, lengths) if memory is None else memory, m)
    # The scores of a parameter on a bound have a mean, which is not noise.
    mean = scores.mean(axis=0)
    stretches = [rows for rows in _stretches(lengths) if rows.stop - rows.start > 1]
    if not stretches:
        return (scores - mean).T @ (scores - mean)
    now, next_ = np.zeros((p, p)), np.zeros((p, p))
    for stretch in stretches:
        for first in range(stretch.start, stretch.stop - 1, ROWS_AT_ONCE):
            part = scores[first : min(first + ROWS_AT_ONCE + 1, stretch.stop)] - mean
            now += part[:-1].T @ part[:-1]
            next_ += part[:-1].T @ part[1:]
    common = float(np.trace(np.linalg.pinv(now, hermitian=True) @ next_)) / p
    r = float(
        np.clip(common, -BLOCK_SETTINGS.max_prewhitening_coefficient, BLOCK_SETTINGS.max_prewhitening_coefficient)
    )
    stride = max(1, block // BLOCK_SETTINGS.block_starts_per_length)
    total, rows = np.zeros((p, p)), 0
    for stretch in stretches:
        n = stretch.stop - stretch.start - 1
        blocks = np.empty((p, len(range(0, n + block, stride))))
        for k, into in enumerate(blocks):  # one parameter at a time, to save memory
            part = scores[stretch, k] - mean[k]
            summed = np.zeros(n + 2 * block)
            np.cumsum(part[1:] - r * part[:-1], out=summed[block : block + n])
            summed[block + n :] = summed[block + n - 1]
            np.subtract(summed[block::stride], summed[: n + block : stride], out=into)
        total += blocks @ blocks.T * (stride / block)
        rows += n
    few = student_to_normal_ratio(degrees_of_freedom(block, m))
    return total * (m / rows) * few**2 / ((1.0 - r) ** 2 * (1.0 - block / m))


def relative_error_factor(measured: np.ndarray, residual: np.ndarray, lengths: Sequence[int]) -> float:
    r"""Return the factor between a relative error and the ends of its 95 % confidence interval; NaN without an error.

    The error :math:`e`, ||residual|| / ||measured||, solves :math:`\sum_t (r_t^2 - e^2 y_t^2) = 0`. The long-run
    variance of this sum gives the standard error of :math:`\log e`. `measured` and `residual`, (m,), are stretches of
    the given `lengths`.
    """
    size = float(np.sum(measured**2))
    square = float(np.sum(residual**2)) / size if size > 0.0 else 0.0
    if not square > 0.0:
        return float("nan")
    scores = residual**2 - square * measured**2
    spread = float(np.sqrt(long_run_covariance(scores[:, None], scores, lengths)[0, 0])) / size
    return float(np.exp(0.5 * NORMAL_QUANTILE_975 * spread / square))


def degrees_of_freedom(block: int, rows: int) -> float:
    """Return the degrees of freedom of a variance from overlapping blocks of length `block` in `rows` rows [1]_."""
    return 1.5 * rows / max(block, 1)


def student_to_normal_ratio(freedom: float) -> float:
    """Return the ratio of Student's 97.5 % quantile to the normal one; infinite without degrees of freedom.

    The expansion [5]_ is accurate to 2e-6 from 12 degrees of freedom on. SciPy's function takes a third of a second to
    load.
    """
    if not freedom > 0.0:
        return float("inf")
    x, terms = NORMAL_QUANTILE_975, 0.0
    for powers, divisor in STUDENT_EXPANSION:
        terms = terms / freedom + sum(c * x**k for k, c in powers.items()) / divisor
    return 1.0 + terms / (freedom * x)


@np.errstate(over="ignore", invalid="ignore")
def sandwich_covariance(
    jacobian: np.ndarray,
    residual: np.ndarray,
    lengths: Sequence[int],
    instruments: np.ndarray | None = None,
    free: np.ndarray | None = None,
    memory: float | None = None,
) -> np.ndarray:
    """Return the covariance, (p, p), of an estimate that solves Z^T rho = 0, robust to autocorrelation.

    `jacobian` W and `instruments` Z have shape (m, p), `residual` rho (m,), the mask `free` (p,). `memory` is the
    residual's correlation time in samples, if known. Parameters that the rows cannot tell apart have infinite variance.
    """
    p = jacobian.shape[1]
    free = np.ones(p, bool) if free is None else free
    w = some_columns(jacobian, free)
    z = w if instruments is None else some_columns(instruments, free)
    scale = column_norms(w)
    bread = _inverse(z, w, scale)
    if bread is None:
        return np.diag(np.where(free, np.inf, 0.0))
    scores = z / scale
    scores *= residual[:, None]
    meat = long_run_covariance(scores, residual, lengths, memory)
    correction = len(residual) / max(len(residual) - int(free.sum()), 1)
    covariance = np.zeros((p, p))
    covariance[np.ix_(free, free)] = correction * (bread @ meat @ bread.T) / np.outer(scale, scale)
    return covariance


def _inverse(left: np.ndarray, right: np.ndarray, scale: np.ndarray) -> np.ndarray | None:
    """Return the inverse of `left`^T `right`, both (m, p) with columns divided by `scale`, (p,); None if singular."""
    if not np.all(scale > 0.0):
        return None
    try:
        return np.linalg.inv(left.T @ right / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return None


@np.errstate(over="ignore", invalid="ignore")
def block_bootstrap(
    jacobian: np.ndarray,
    residual: np.ndarray,
    values: np.ndarray,
    lengths: Sequence[int],
    *,
    rng: np.random.Generator,
    repetitions: int = 2000,
    level: float = 0.95,
    memory: float | None = None,
) -> np.ndarray:
    """Return percentile intervals at `level`, (p, 2), by resampling blocks of scores on the linearised model.

    `jacobian` has shape (m, p), `residual` (m,), `values` (p,). `memory` is the residual's correlation time in samples,
    if known.
    """
    scale = column_norms(jacobian)
    if not np.isfinite(residual).all() or _inverse(jacobian, jacobian, scale) is None:
        return np.tile([-np.inf, np.inf], (len(values), 1))
    gram = jacobian.T @ jacobian / np.outer(scale, scale)
    rows = len(residual)
    # Longer blocks than needed do no harm, and more blocks do not improve the interval.
    memory = correlation_time(residual, lengths) if memory is None else memory
    block = max(block_length(memory, rows), rows // BLOCK_SETTINGS.max_bootstrap_blocks)
    # A row for each parameter: its draws then lie side by side. Hours of data have no memory for all scores at once.
    together = max(1, BLOCK_SETTINGS.max_scores_at_once // rows)
    groups = [slice(first, first + together) for first in range(0, len(scale), together)]
    pool = np.concatenate([_sums_of_blocks(jacobian[:, own] / scale[own], residual, lengths, block) for own in groups])
    count = max(1, round(rows / block))
    at_once = max(1, BLOCK_SETTINGS.max_blocks_drawn_at_once // count)
    totals = np.empty((len(values), repetitions))
    for done in range(0, repetitions, at_once):
        drawn = rng.integers(0, pool.shape[1], (min(at_once, repetitions - done), count))
        for own, into in zip(pool, totals, strict=True):
            into[done : done + len(drawn)] = own.take(drawn).sum(axis=1)
    steps = np.linalg.solve(gram, totals).T
    tail = 50.0 * (1.0 - level)
    return values[:, None] + (np.percentile(steps, [tail, 100.0 - tail], axis=0) / scale).T


def _sums_of_blocks(columns: np.ndarray, residual: np.ndarray, lengths: Sequence[int], block: int) -> np.ndarray:
    """Return the sums of the scores, `columns` (m, p) times `residual` (m,), over overlapping blocks, (p, b).

    `columns` are overwritten.
    """
    scores, sums = columns, []
    scores *= residual[:, None]
    scores -= scores.mean(axis=0)
    # Blocks wrap around within each stretch, so that its ends are drawn as often as its middle.
    for stretch in _stretches(lengths):
        n = stretch.stop - stretch.start
        if n:
            length = min(block, n)
            wrapped = np.concatenate([np.zeros((1, scores.shape[1])), scores[stretch], scores[stretch][: length - 1]])
            ends = np.cumsum(wrapped, axis=0)
            # The sum over a stretch shorter than a block is scaled to the variance of a whole block.
            sums.append(
                (ends[length:] - ends[:-length])[:: max(1, block // BLOCK_SETTINGS.block_starts_per_length)]
                * np.sqrt(block / length)
            )
    return np.concatenate(sums).T.copy()


@np.errstate(over="ignore", invalid="ignore")
def whiteness(residual: np.ndarray, lengths: Sequence[int], lags: int = 20) -> Whiteness:
    """Apply the Ljung-Box test to a residual, (m,), pooled over stretches; NaN if nothing is left to test."""
    ends = np.cumsum(lengths)
    parts = [residual[e - n : e] for e, n in zip(ends, lengths, strict=True) if n > lags + 1]
    nothing = Whiteness(float("nan"), float("nan"), float("nan"), lags, float("nan"))
    if not parts or not all(np.isfinite(p).all() for p in parts):
        return nothing
    mean = np.mean(np.concatenate(parts))
    parts = [p - mean for p in parts]
    power = sum(float(p @ p) for p in parts)
    if not power > 0.0:
        return nothing
    n = sum(len(p) for p in parts)
    rho = np.array([sum(float(p[k:] @ p[:-k]) for p in parts) / power for k in range(1, lags + 1)])
    statistic = float(n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, lags + 1))))
    # The sum ends at the first autocorrelation that is not positive; later ones are mostly noise.
    positive = rho[: int(np.argmax(rho <= 0.0))] if np.any(rho <= 0.0) else rho
    share = float(1.0 / (1.0 + 2.0 * positive.sum()))
    return Whiteness(float(rho[0]), statistic, chi_square_tail(lags, statistic), lags, share)


def correlation_length(misfit: np.ndarray) -> float:
    """Samples that share one independent value: the integrated autocorrelation up to its first zero. `misfit` (n,)."""
    misfit = np.asarray(misfit, float).reshape(len(misfit), -1)
    n = len(misfit)
    padded = 1 << (2 * n - 1).bit_length()  # a power of two is transformed fastest
    spectrum = np.abs(np.fft.rfft(misfit - misfit.mean(axis=0), padded, axis=0)) ** 2
    correlation = np.fft.irfft(spectrum.sum(axis=1))[:n]
    if correlation[0] <= 0.0:
        return 1.0
    end = int(np.argmax(correlation <= 0.0)) or n
    return float(np.clip(1.0 + 2.0 * np.sum(correlation[1:end]) / correlation[0], 1.0, np.sqrt(n)))
