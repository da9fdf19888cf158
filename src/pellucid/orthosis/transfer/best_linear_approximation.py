r"""Frequency responses: the best linear approximation under random-phase multisines [1]_, and one of any excitation.

Between periods of one realisation only noise changes. Between realisations the stochastic nonlinear distortion changes
too:

.. math::
   Y_m(k) = G(k)\,U_m(k) + Y_{S,m}(k) + N_m(k), \qquad
   \hat G = \frac{\sum_m Y_m \bar R_m}{\sum_m U_m \bar R_m}, \qquad V_m = Y_m - \hat G U_m

R is the reference, which is free of the noise that a controller feeds back, or the input itself in open loop. In the
spectrum of P periods, the periodic part is at every P-th bin (a line); the bins between contain noise and the
transient, which is smooth in frequency. A polynomial through these bins gives the transient at the line, which is
subtracted, and the residual gives the noise variance. The variance of V over realisations minus the noise variance is
that of the distortion. Lines that the multisine does not excite show even and odd distortion directly.

.. [1] R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., Wiley, 2012, ch. 4, 7.

Without periods (`local_response`) a local polynomial gives the response, and noise and distortion together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, gamma
from scipy.stats import f as f_distribution

from ..._errors import IdentificationError

TRANSIENT_DEGREE = 2
"""Degree of the polynomial that represents the transient around a line."""

NOISE_BINS_PER_LINE = 12
"""Number of bins between lines, around each line, from which transient and noise are estimated."""

MIN_LINE_CONTRAST = 3.0
"""The weakest excited line must be at least this many times stronger than the strongest line that is not excited."""


@dataclass(frozen=True)
class UnexcitedLines:
    """Lines in the band that are not excited, where power beyond the noise is distortion."""

    line: np.ndarray  # (d,) harmonic numbers
    frequency: np.ndarray  # (d,) [Hz]
    power: (
        np.ndarray
    )  # (d,) mean |V|^2 over realisations minus the noise's, in output unit^2; may be negative by chance
    noise: np.ndarray  # (d,) noise variance of one period's spectrum


@dataclass(frozen=True, eq=False)
class BestLinearApproximation:
    """A frequency response with the variances of noise and distortion at each excited line.

    Spectra are complex amplitudes of one period (a sine of amplitude A has A/2). Variances are those of one period of
    one realisation at the output, corrected for the part that feedback causes at the input.
    """

    line: np.ndarray  # (k,) numbers of the excited harmonics
    frequency: np.ndarray  # (k,) [Hz]
    response: np.ndarray  # (k,) complex response, output unit per input unit
    input_power: np.ndarray  # (k,) mean |U|^2 over realisations
    noise_variance: np.ndarray  # (k,) variance of the noise
    # (k,) total minus noise variance, which may be negative by chance; with one realisation from unexcited odd lines
    nonlinear_variance: np.ndarray
    response_variance: np.ndarray  # (k,) variance of the response, averaged over all periods and realisations
    left_out: UnexcitedLines
    realisations: int
    periods: int
    noise_freedom: int  # complex degrees of freedom of `noise_variance` at a line
    p_value: float  # p value of the hypothesis that there is no distortion, over all lines
    highest_fit: float  # best fit that any linear model can reach on these periods [%]
    highest_fit_limit: float  # upper 95 % confidence limit of that fit [%]
    highest_fit_noise: float  # best fit if there were noise alone [%]
    closed_loop: bool

    @property
    def even(self) -> np.ndarray:
        """Whether each unexcited line is even, shape (d,)."""
        return self.left_out.line % 2 == 0

    @property
    def even_share(self) -> float:
        """Share of the distortion on even lines, per line; NaN without unexcited even and odd lines."""
        level = [
            float(np.mean(self.left_out.power[side])) if side.any() else np.nan for side in (self.even, ~self.even)
        ]
        even, odd = (max(x, 0.0) if np.isfinite(x) else x for x in level)
        return even / (even + odd) if even + odd > 0.0 else np.nan

    @property
    def nonlinear_to_noise(self) -> float:
        """Variance of the distortion divided by that of the noise, both summed over excited lines; at least 0."""
        return max(float(np.sum(self.nonlinear_variance) / np.sum(self.noise_variance)), 0.0)

    def at_response(self, variance: np.ndarray) -> np.ndarray:
        """Convert a variance at the output to one of the response from a single period, both (k,)."""
        return variance / self.input_power

    def radius(self, confidence: float = 0.95) -> np.ndarray:
        """Return the radius of the confidence disk around each response, shape (k,)."""
        freedom = self.realisations - 1 if self.realisations > 1 else self.noise_freedom
        return np.sqrt(self.response_variance * f_distribution.ppf(confidence, 2, 2 * freedom))


def best_linear_approximation(
    inputs: Sequence[np.ndarray],
    outputs: Sequence[np.ndarray],
    rate: float,
    *,
    samples: int,
    references: Sequence[np.ndarray] | None = None,
) -> BestLinearApproximation:
    """Estimate the best linear approximation from m realisations of a random-phase multisine.

    `inputs`, `outputs` and `references` are m arrays of shape (n,) at a `rate` [Hz]. Each realisation is a whole number
    of periods of `samples` samples, with the same lines and amplitudes.
    """
    u, y = (np.asarray(x, float) for x in (inputs, outputs))
    r = u if references is None else np.asarray(references, float)
    n = u.shape[-1]
    periods = n // samples
    if not (u.shape == y.shape == r.shape and u.ndim == 2):
        raise IdentificationError(
            f"found inputs, outputs, references of shapes {u.shape}, {y.shape}, {r.shape}, expected one shape"
        )
    if periods < 2 or n % samples:
        raise IdentificationError(
            f"found {n / samples:.3g} periods of {samples} samples, expected a whole number, 2 at least"
        )
    if not all(np.isfinite(x).all() for x in (u, y, r)):
        raise IdentificationError("found missing samples, expected a number in each of every period")
    both, driving = np.fft.rfft(np.stack([u, y], axis=-1), axis=1) / n, np.fft.rfft(r, axis=1) / n
    count = len(u)
    line = excited_lines(np.sqrt(np.mean(np.abs(driving[:, ::periods]) ** 2, axis=0)))
    every = np.arange(line[0], line[-1] + 1)
    settled, covariance, grown, windows = _remove_transients(both, every, periods)
    is_line = np.isin(every, line)
    # (m, k) the reference's spectrum at excited lines
    reference = driving[:, line * periods]
    cross = np.sum(settled[:, is_line] * np.conj(reference)[:, :, None], axis=0)
    response = cross[:, 1] / cross[:, 0]
    everywhere = np.interp(every, line, response.real) + 1j * np.interp(every, line, response.imag)
    missed = settled[:, :, 1] - everywhere * settled[:, :, 0]
    weights = np.stack([-everywhere, np.ones_like(everywhere)], axis=1)
    # Noise variance of V averaged over periods, at every line in the band; mean over realisations.
    noise = np.einsum("ki,mkij,kj->mk", weights, covariance, np.conj(weights)).real.mean(axis=0)
    inside = np.abs(missed) ** 2
    freedom = windows.shape[1] - (TRANSIENT_DEGREE + 1)
    total = inside[:, is_line].sum(axis=0) / (count - 1) if count > 1 else np.full(len(line), np.nan)
    left = ~is_line
    power = inside[:, left].mean(axis=0) - grown[left] * noise[left]
    nonlinear = total - grown[is_line] * noise[is_line]
    if count == 1:
        odd = left & (every % 2 == 1)
        known = power[odd[left]]
        nonlinear = np.interp(line, every[odd], known) if odd.any() else np.full(len(line), np.nan)
    # Power of the input's part that the reference causes, summed over realisations.
    through = np.abs(cross[:, 0]) ** 2 / np.sum(np.abs(reference) ** 2, axis=0)
    of_one = grown[is_line] * noise[is_line] + (np.nan_to_num(np.maximum(nonlinear, 0.0)) if count == 1 else 0.0)
    ratio = np.where(is_line, np.nan, inside.mean(axis=0))
    ratio[is_line] = total
    degrees = np.where(is_line, count - 1, count)
    outside = np.abs(both[:, :, 1]) ** 2
    outside[:, 0] = 0.0
    # Above the band, too, harmonics are at every P-th bin and noise is at all bins.
    high = np.arange(line[-1] * periods + (periods + 1) // 2, outside.shape[1])
    beyond = outside[:, high].sum() / count
    noise_beyond = outside[:, high[high % periods != 0]].sum() / count * periods / (periods - 1.0)
    # No linear model has a smaller residual than one with a free gain at every line, which includes the fed-back noise.
    least = _smallest_residual_power(settled) if count > 1 else np.where(is_line, 0.0, inside.mean(axis=0))
    if count == 1:
        least[is_line] = np.maximum(np.nan_to_num(nonlinear), 0.0) + noise[is_line]
    floor = np.maximum(covariance[:, :, 1, 1].real - _noise_explained_by_input(covariance), 0.0).mean(axis=0)
    whole = outside.sum(axis=1).mean()
    missed_power = least.sum() + (periods - 1) * floor.sum() + beyond
    # A sum of independent powers is approximately chi-squared (Satterthwaite), with fewer degrees of freedom where few
    # lines dominate.
    freely = 2.0 * max(count - 1, 1) * least.sum() ** 2 / max(float(least @ least), 1e-300)
    lowest = missed_power * freely / chi2.isf(0.05, freely)
    return BestLinearApproximation(
        line=line,
        frequency=line * rate / samples,
        response=response,
        input_power=np.mean(np.abs(settled[:, is_line, 0]) ** 2, axis=0),
        noise_variance=periods * noise[is_line],
        nonlinear_variance=nonlinear,
        response_variance=(total if count > 1 else of_one) / through,
        left_out=UnexcitedLines(every[left], every[left] * rate / samples, power, periods * noise[left]),
        realisations=count,
        periods=periods,
        noise_freedom=freedom * count,
        p_value=_p_value(ratio / (grown * noise), degrees, freedom * count, windows),
        highest_fit=_fit_percent(missed_power / whole),
        highest_fit_limit=_fit_percent(lowest / whole),
        highest_fit_noise=_fit_percent((periods * floor.sum() + noise_beyond) / whole),
        closed_loop=references is not None,
    )


def excited_lines(amplitude: np.ndarray) -> np.ndarray:
    """Return the numbers of the excited harmonics, (k,), from a period's `amplitude` spectrum, which begins with the
    mean."""
    size = np.maximum(amplitude[1:], 1e-9 * amplitude[1:].max(initial=1e-300))
    order = np.sort(size)[::-1]
    if len(order) < 2:
        raise IdentificationError(
            f"found a period with {len(order)} frequencies, expected two or more: check the period"
        )
    steps = order[:-1] / order[1:]
    cut = int(np.argmax(steps))
    if steps[cut] < MIN_LINE_CONTRAST:
        raise IdentificationError(
            f"found excited frequencies only {steps[cut]:.2g} times as strong as the others, expected at least "
            f"{MIN_LINE_CONTRAST:g} times: check the period, or state the reference"
        )
    return np.flatnonzero(size >= order[cut]) + 1


def _remove_transients(
    both: np.ndarray, lines: np.ndarray, periods: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Subtract the transients from the spectra.

    Returns the spectra at the lines (m, k, 2), the noise covariances there (m, k, 2, 2), the factors by which
    subtracting the transient increased the noise (k,), and the bins that were used, (k, w).
    """
    last = both.shape[1] - 1
    between = np.setdiff1d(np.arange(1, last), np.arange(0, last, periods))
    width = min(NOISE_BINS_PER_LINE, len(between))
    if width <= TRANSIENT_DEGREE + 1:
        raise IdentificationError(
            f"found {len(between)} frequencies between the excited ones, expected {TRANSIENT_DEGREE + 2}: record more "
            "periods"
        )
    centre = np.searchsorted(between, lines * periods)
    first = np.clip(centre - width // 2, 0, len(between) - width)
    windows = between[first[:, None] + np.arange(width)]
    settled = np.empty((len(both), len(lines), 2), complex)
    covariance = np.empty((len(both), len(lines), 2, 2), complex)
    grown = np.empty(len(lines))
    patterns, which = np.unique(windows - lines[:, None] * periods, axis=0, return_inverse=True)
    for i, offset in enumerate(patterns):
        at = np.flatnonzero(which.ravel() == i)
        columns = (offset / np.abs(offset).max())[:, None] ** np.arange(TRANSIENT_DEGREE + 1)
        inverse = np.linalg.pinv(columns)
        seen = both[:, windows[at]]  # (m, k, w, 2)
        settled[:, at] = both[:, lines[at] * periods] - np.einsum("w,mkwi->mki", inverse[0], seen)
        residual = seen - np.einsum("vw,mkwi->mkvi", columns @ inverse, seen)
        covariance[:, at] = np.einsum("mkwi,mkwj->mkij", residual, np.conj(residual)) / (width - TRANSIENT_DEGREE - 1)
        grown[at] = 1.0 + inverse[0] @ inverse[0]
    return settled, covariance, grown, windows


def _smallest_residual_power(settled: np.ndarray) -> np.ndarray:
    """Return the unbiased mean |Y - g U|^2 over realisations at each line, (k,), for the best g at that line.

    `settled`, shape (m, k, 2), are the spectra of input and output without transients.
    """
    u, y = settled[:, :, 0], settled[:, :, 1]
    size, moved = np.sum(np.abs(u) ** 2, axis=0), np.sum(np.abs(y) ** 2, axis=0)
    driven = size > 1e-20 * size.max()
    explained = np.abs(np.sum(y * np.conj(u), axis=0)) ** 2 / np.where(driven, size, np.inf)
    return np.maximum(moved - explained, 0.0) / np.where(driven, len(settled) - 1, len(settled))


def _noise_explained_by_input(covariance: np.ndarray) -> np.ndarray:
    """Return the part of the output's noise variance that the input's noise explains, (m, k)."""
    size = covariance[:, :, 0, 0].real
    return np.abs(covariance[:, :, 1, 0]) ** 2 / np.where(size > 1e-20 * size.max(initial=1e-300), size, np.inf)


def _p_value(ratio: np.ndarray, degrees: np.ndarray, freedom: int, windows: np.ndarray) -> float:
    """Return the p value of variance ratios with `degrees` over `freedom` complex degrees of freedom, taken together.

    The weighted mean of the ratios is approximated by a gamma variable of the same mean and variance. The variance
    allows for the bins that several denominators share.
    """
    used = degrees > 0
    if not used.any() or freedom < 3:
        return float("nan")
    weight = degrees[used] / degrees[used].sum()
    inverse, squared = freedom / (freedom - 1.0), freedom**2 / ((freedom - 1.0) * (freedom - 2.0))
    shares = np.zeros(windows.max() + 1)
    np.add.at(shares, windows[used], np.broadcast_to(weight[:, None], windows[used].shape))
    overlap = float(shares @ shares) / windows.shape[1]
    variance = squared * float(np.sum(weight**2 / degrees[used])) + (squared - inverse**2) * overlap
    return float(gamma.sf(weight @ ratio[used], inverse**2 / variance, scale=variance / inverse))


def _fit_percent(share: float) -> float:
    return float(100.0 * (1.0 - np.sqrt(min(max(share, 0.0), 1.0))))


LOCAL_DEGREE = 2
"""Degree of the local polynomials."""

RESIDUAL_DEGREES_OF_FREEDOM = 10
"""Number of complex equations at each bin beyond the number of unknowns; they determine the noise."""

MAX_SHOWN_BINS = 400
"""Largest number of bins at which the response is returned, evenly spaced in the logarithm of frequency."""

MAX_EVALUATED_BINS = 4000
"""Largest number of bins over which the powers for the fit are summed, evenly spaced in frequency."""

MIN_EXCITED_POWER_SHARE = 1e-4
"""A bin counts as excited if the input power around it exceeds this share of the largest local input power."""


@dataclass(frozen=True, eq=False)
class LocalResponse:
    """A nonparametric frequency response with the power that it does not explain (noise and distortion)."""

    frequency: np.ndarray  # (k,) [Hz]
    response: np.ndarray  # (k,) complex response, output unit per input unit
    variance: np.ndarray  # (k,) variance of the complex response, E|G - G0|^2
    input_power: np.ndarray  # (k,) mean |U|^2 around each bin
    missed_power: np.ndarray  # (k,) part of |Y|^2 that no linear model explains
    freedom: int  # complex degrees of freedom of `missed_power` at a bin
    fit: float  # share of the output that is explained at excited bins [%]; no upper bound for models, bins are few
    closed_loop: bool  # whether input and output were regressed on a reference

    def radius(self, confidence: float = 0.95) -> np.ndarray:
        """Return the radius of the confidence disk around each response, shape (k,)."""
        return np.sqrt(self.variance * f_distribution.ppf(confidence, 2, 2 * self.freedom))


def local_response(
    input: np.ndarray, output: np.ndarray, rate: float, *, reference: np.ndarray | None = None
) -> LocalResponse:
    """Estimate the frequency response from evenly sampled signals of shape (n,) at a `rate` [Hz].

    `reference`, shape (n,), is the reference signal where a controller closes the loop.
    """
    signals = [np.asarray(x, float) for x in (input, output)]
    cause = signals[0] if reference is None else np.asarray(reference, float)
    half = -(-(2 * (LOCAL_DEGREE + 1) + RESIDUAL_DEGREES_OF_FREEDOM - 1) // 2)
    n = len(cause)
    if n < 8 * half:
        raise IdentificationError(f"found {n} samples, expected at least {8 * half} for a frequency response")
    if any(not np.isfinite(x).all() or np.ptp(x) == 0.0 for x in (cause, *signals)):
        raise IdentificationError(
            "found a signal that is constant or has missing samples, expected complete signals that change"
        )
    # Bin k has the frequency k rate / n. The means are removed, because they are no part of a response.
    driving = np.fft.rfft(cause - cause.mean()) / n
    both = np.stack([np.fft.rfft(x - x.mean()) / n for x in signals], axis=1)
    power = np.convolve(np.abs(driving) ** 2, np.ones(2 * half + 1) / (2 * half + 1), "same")
    inside = np.arange(half + 1, len(driving) - half)
    excited = inside[power[inside] > MIN_EXCITED_POWER_SHARE * power[inside].max()]
    offset = np.arange(-half, half + 1)

    def at(bins: np.ndarray) -> tuple[np.ndarray, ...]:
        return _local(driving, both, power, bins, offset)

    # The fit is evaluated at bins that the input excites, evenly over frequency.
    _, _, missed = at(excited[:: -(-len(excited) // MAX_EVALUATED_BINS)])
    judged = excited[:: -(-len(excited) // MAX_EVALUATED_BINS), None] + offset
    whole = np.sum(np.mean(np.abs(both[judged][:, :, 1]) ** 2, axis=1))
    if len(excited) > MAX_SHOWN_BINS:
        wanted = np.searchsorted(excited, np.geomspace(excited[0], excited[-1], MAX_SHOWN_BINS))
        excited = np.unique(excited[wanted.clip(max=len(excited) - 1)])
    response, spread, noise = at(excited)
    return LocalResponse(
        frequency=excited * rate / n,
        response=response,
        variance=noise * spread,
        input_power=np.mean(np.abs(both[excited[:, None] + offset][:, :, 0]) ** 2, axis=1),
        missed_power=noise,
        freedom=len(offset) - 2 * (LOCAL_DEGREE + 1),
        fit=float(100.0 * (1.0 - np.sqrt(min(np.sum(missed) / whole, 1.0)))),
        closed_loop=reference is not None,
    )


def _local(
    driving: np.ndarray, both: np.ndarray, power: np.ndarray, centres: np.ndarray, offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return at the bins `centres`, each (k,): the response, its variance per unit of noise, and the noise variance."""
    bins = centres[:, None] + offset
    powers = (offset / offset[-1])[:, None] ** np.arange(LOCAL_DEGREE + 1)
    # The input's columns are scaled by its local magnitude, so that both halves of the columns have equal weight.
    scale = np.sqrt(power[centres])[:, None]
    columns = np.concatenate(
        [(driving[bins] / scale)[:, :, None] * powers, np.broadcast_to(powers, (*bins.shape, LOCAL_DEGREE + 1))], axis=2
    )
    q, r = np.linalg.qr(columns)
    projected = np.conj(np.swapaxes(q, 1, 2)) @ both[bins]
    inverse = np.linalg.pinv(r)
    found = (inverse[:, :1] @ projected)[:, 0] / scale  # per unit of the cause: input and output
    residual = both[bins] - q @ projected
    response = found[:, 1] / found[:, 0]
    missed = residual[:, :, 1] - response[:, None] * residual[:, :, 0]
    noise = np.sum(np.abs(missed) ** 2, axis=1) / (len(offset) - 2 * (LOCAL_DEGREE + 1))
    spread = np.sum(np.abs(inverse[:, 0]) ** 2, axis=1) / scale[:, 0] ** 2 / np.abs(found[:, 0]) ** 2
    return response, spread, noise
