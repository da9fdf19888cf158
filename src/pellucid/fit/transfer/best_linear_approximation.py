r"""The best linear approximation of a system under random-phase multisines, with noise and distortion apart [1]_.

Over periods of one realisation only noise changes, over realisations the stochastic part of a non-linearity too:

.. math::
   Y_m(k) = G(k)\,U_m(k) + Y_{S,m}(k) + N_m(k), \qquad
   \hat G = \frac{\sum_m Y_m \bar R_m}{\sum_m U_m \bar R_m}, \qquad V_m = Y_m - \hat G U_m

R is the reference, which a controller's feedback of noise does not reach, or the input itself where there is none. The
spectrum of P periods has the periodic part at every P-th bin; those between hold noise and the transient, which is
smooth over frequency. A polynomial through them gives the transient at the line, which is taken off, and the noise,
whose variance the residual tells. The variance of V over realisations less that of noise is the distortion's. Lines
that the multisine leaves out show distortion directly, by even and odd powers.

.. [1] R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., Wiley, 2012, ch. 4, 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, gamma
from scipy.stats import f as f_distribution

from ..._errors import IdentificationError

DEGREE = 2
"""Of the polynomial that a transient is locally."""

BETWEEN = 12
"""Bins without a line around each line that tell transient and noise."""

GAP = 3.0
"""Factor between the weakest excited line and the strongest other one, at least."""


@dataclass(frozen=True)
class LeftOut:
    """Lines in the band that nothing excites: what is there beyond noise is distortion."""

    line: np.ndarray  # (d,) Harmonics
    frequency: np.ndarray  # (d,) [Hz]
    power: np.ndarray  # (d,) Mean |V|^2 over realisations less the noise's, in output unit^2; below 0 by chance
    noise: np.ndarray  # (d,) Noise variance of one period's spectrum


@dataclass(frozen=True, eq=False)
class BestLinearApproximation:
    """A frequency response and, line by line, the variances of noise and distortion at the output.

    Spectra are complex amplitudes of one period (a sine of amplitude A has A/2). Variances are of one period of one
    realisation, as seen at the output with what feedback makes of them at the input taken off.
    """

    line: np.ndarray  # (k,) Excited harmonics
    frequency: np.ndarray  # (k,) [Hz]
    response: np.ndarray  # (k,) Complex, output unit per input unit
    input_power: np.ndarray  # (k,) Mean |U|^2 over realisations
    noise_variance: np.ndarray  # (k,)
    total_variance: np.ndarray  # (k,) Noise and distortion
    nonlinear_variance: (
        np.ndarray
    )  # (k,) Total less noise, below 0 by chance; of one realisation from odd lines left out
    response_variance: np.ndarray  # (k,) Of the response, all periods and realisations averaged
    left_out: LeftOut
    realisations: int
    periods: int
    noise_freedom: int  # Complex degrees of freedom of `noise_variance` at a line
    p_value: float  # That the distortion is none, all lines together
    highest_fit: float  # What one linear model for all can fit of these periods at best [%]
    highest_fit_limit: float  # Below which that is with 95 % confidence [%]
    highest_fit_noise: float  # What it could if there were noise alone [%]
    closed_loop: bool

    @property
    def even(self) -> np.ndarray:
        """Which lines left out are even, shape (d,) of bool."""
        return self.left_out.line % 2 == 0

    @property
    def even_share(self) -> float:
        """Even lines' share of the distortion, per line; NaN where none or no odd ones are left out."""
        level = [
            float(np.mean(self.left_out.power[side])) if side.any() else np.nan for side in (self.even, ~self.even)
        ]
        even, odd = (max(x, 0.0) if np.isfinite(x) else x for x in level)
        return even / (even + odd) if even + odd > 0.0 else np.nan

    @property
    def nonlinear_to_noise(self) -> float:
        """Distortion's variance over the noise's, sums over excited lines; not below 0."""
        return max(float(np.sum(self.nonlinear_variance) / np.sum(self.noise_variance)), 0.0)

    def at_response(self, variance: np.ndarray) -> np.ndarray:
        """A variance at the output as one of the response from a single period, both (k,)."""
        return variance / self.input_power

    def radius(self, confidence: float = 0.95) -> np.ndarray:
        """Of a disk around each response that holds the true one with a confidence, shape (k,)."""
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
    """Of realisations, each a whole number of periods of so many `samples` at a `rate` [Hz].

    `inputs`, `outputs`, `references` (m,) of (n,); one n for all, and the same lines and amplitudes in each.
    """
    u, y = (np.asarray(x, float) for x in (inputs, outputs))
    r = u if references is None else np.asarray(references, float)
    n = u.shape[-1]
    periods = n // samples
    if not (u.shape == y.shape == r.shape and u.ndim == 2):
        raise IdentificationError(f"found inputs, outputs, references of shapes {u.shape}, {y.shape}, {r.shape}")
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
    settled, covariance, grown, windows = _settled(both, every, periods)
    is_line = np.isin(every, line)
    # (m, k): of the transient-free spectra at excited lines
    reference = driving[:, line * periods]
    cross = np.sum(settled[:, is_line] * np.conj(reference)[:, :, None], axis=0)
    response = cross[:, 1] / cross[:, 0]
    everywhere = np.interp(every, line, response.real) + 1j * np.interp(every, line, response.imag)
    missed = settled[:, :, 1] - everywhere * settled[:, :, 0]
    weights = np.stack([-everywhere, np.ones_like(everywhere)], axis=1)
    # Of V averaged over periods, (every,): mean over realisations
    noise = np.einsum("ki,mkij,kj->mk", weights, covariance, np.conj(weights)).real.mean(axis=0)
    inside = np.abs(missed) ** 2
    freedom = windows.shape[1] - (DEGREE + 1)
    total = inside[:, is_line].sum(axis=0) / (count - 1) if count > 1 else np.full(len(line), np.nan)
    left = ~is_line
    power = inside[:, left].mean(axis=0) - grown[left] * noise[left]
    nonlinear = total - grown[is_line] * noise[is_line]
    if count == 1:
        odd = left & (every % 2 == 1)
        known = power[odd[left]]
        nonlinear = np.interp(line, every[odd], known) if odd.any() else np.full(len(line), np.nan)
    through = np.abs(cross[:, 0]) ** 2 / np.sum(np.abs(reference) ** 2, axis=0)  # power of what R makes in U, all m
    of_one = grown[is_line] * noise[is_line] + (np.nan_to_num(np.maximum(nonlinear, 0.0)) if count == 1 else 0.0)
    ratio = np.where(is_line, np.nan, inside.mean(axis=0))
    ratio[is_line] = total
    degrees = np.where(is_line, count - 1, count)
    outside = np.abs(both[:, :, 1]) ** 2
    outside[:, 0] = 0.0
    # Above the band too harmonics stand at every P-th bin, and noise at all.
    high = np.arange(line[-1] * periods + (periods + 1) // 2, outside.shape[1])
    beyond = outside[:, high].sum() / count
    noise_beyond = outside[:, high[high % periods != 0]].sum() / count * periods / (periods - 1.0)
    # No linear model misses less than one with a gain of its own at every line, fed back noise and all.
    least = _least_missed(settled) if count > 1 else np.where(is_line, 0.0, inside.mean(axis=0))
    if count == 1:
        least[is_line] = np.maximum(np.nan_to_num(nonlinear), 0.0) + noise[is_line]
    floor = np.maximum(covariance[:, :, 1, 1].real - _explained(covariance), 0.0).mean(axis=0)
    whole = outside.sum(axis=1).mean()
    missed_power = least.sum() + (periods - 1) * floor.sum() + beyond
    # A sum of independent powers is nearly a chi-squared variable, of fewer degrees where few lines are most of it.
    freely = 2.0 * max(count - 1, 1) * least.sum() ** 2 / max(float(least @ least), 1e-300)
    lowest = missed_power * freely / chi2.isf(0.05, freely)
    return BestLinearApproximation(
        line=line,
        frequency=line * rate / samples,
        response=response,
        input_power=np.mean(np.abs(settled[:, is_line, 0]) ** 2, axis=0),
        noise_variance=periods * noise[is_line],
        total_variance=nonlinear + periods * noise[is_line],
        nonlinear_variance=nonlinear,
        response_variance=(total if count > 1 else of_one) / through,
        left_out=LeftOut(every[left], every[left] * rate / samples, power, periods * noise[left]),
        realisations=count,
        periods=periods,
        noise_freedom=freedom * count,
        p_value=_p_value(ratio / (grown * noise), degrees, freedom * count, windows),
        highest_fit=_fit(missed_power / whole),
        highest_fit_limit=_fit(lowest / whole),
        highest_fit_noise=_fit((periods * floor.sum() + noise_beyond) / whole),
        closed_loop=references is not None,
    )


def excited_lines(amplitude: np.ndarray) -> np.ndarray:
    """Harmonics, (k,), that stand out of a period's `amplitude` spectrum, which begins with the mean."""
    size = np.maximum(amplitude[1:], 1e-9 * amplitude[1:].max(initial=1e-300))
    order = np.sort(size)[::-1]
    if len(order) < 2:
        raise IdentificationError(f"found a period of {len(order)} lines, expected two at least")
    steps = order[:-1] / order[1:]
    cut = int(np.argmax(steps))
    if steps[cut] < GAP:
        raise IdentificationError(
            f"found no gap above a factor {steps[cut]:.2g} between lines that are excited and others, expected "
            f"{GAP:g}: the period is another one, or a reference is needed"
        )
    return np.flatnonzero(size >= order[cut]) + 1


def _settled(
    both: np.ndarray, lines: np.ndarray, periods: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Spectra at lines without transients (m, k, 2), covariances of noise there (m, k, 2, 2), by which taking off the
    transient grew them (k,), and the bins that told, (k, w)."""
    last = both.shape[1] - 1
    between = np.setdiff1d(np.arange(1, last), np.arange(0, last, periods))
    width = min(BETWEEN, len(between))
    if width <= DEGREE + 1:
        raise IdentificationError(f"found {len(between)} bins between lines, expected {DEGREE + 2} at least")
    centre = np.searchsorted(between, lines * periods)
    first = np.clip(centre - width // 2, 0, len(between) - width)
    windows = between[first[:, None] + np.arange(width)]
    settled = np.empty((len(both), len(lines), 2), complex)
    covariance = np.empty((len(both), len(lines), 2, 2), complex)
    grown = np.empty(len(lines))
    patterns, which = np.unique(windows - lines[:, None] * periods, axis=0, return_inverse=True)
    for i, offset in enumerate(patterns):
        at = np.flatnonzero(which.ravel() == i)
        columns = (offset / np.abs(offset).max())[:, None] ** np.arange(DEGREE + 1)
        inverse = np.linalg.pinv(columns)
        seen = both[:, windows[at]]  # (m, k, w, 2)
        settled[:, at] = both[:, lines[at] * periods] - np.einsum("w,mkwi->mki", inverse[0], seen)
        residual = seen - np.einsum("vw,mkwi->mkvi", columns @ inverse, seen)
        covariance[:, at] = np.einsum("mkwi,mkwj->mkij", residual, np.conj(residual)) / (width - DEGREE - 1)
        grown[at] = 1.0 + inverse[0] @ inverse[0]
    return settled, covariance, grown, windows


def _least_missed(settled: np.ndarray) -> np.ndarray:
    """Mean |Y - g U|^2 over realisations at each line, (k,), for the best g there, unbiased; `settled` (m, k, 2)."""
    u, y = settled[:, :, 0], settled[:, :, 1]
    size, moved = np.sum(np.abs(u) ** 2, axis=0), np.sum(np.abs(y) ** 2, axis=0)
    driven = size > 1e-20 * size.max()
    explained = np.abs(np.sum(y * np.conj(u), axis=0)) ** 2 / np.where(driven, size, np.inf)
    return np.maximum(moved - explained, 0.0) / np.where(driven, len(settled) - 1, len(settled))


def _explained(covariance: np.ndarray) -> np.ndarray:
    """What of the output's noise the input's explains, (m, k); `covariance` (m, k, 2, 2)."""
    size = covariance[:, :, 0, 0].real
    return np.abs(covariance[:, :, 1, 0]) ** 2 / np.where(size > 1e-20 * size.max(initial=1e-300), size, np.inf)


def _p_value(ratio: np.ndarray, degrees: np.ndarray, freedom: int, windows: np.ndarray) -> float:
    """That variance `ratio`s of `degrees` over `freedom` complex degrees are this large by chance, all together.

    Their weighted mean has the mean and, with what denominators share, the variance of a gamma variable."""
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


def _fit(share: float) -> float:
    return float(100.0 * (1.0 - np.sqrt(min(max(share, 0.0), 1.0))))
