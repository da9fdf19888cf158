r"""Nonparametric frequency response of any recording, by local polynomials over a few frequency bins [1]_.

.. math::  Y(k + r) = \Big(\sum_s g_s r^s\Big)\,U(k + r) + \sum_s t_s r^s + V(k + r), \qquad |r| \le n

Response and transient are assumed to be smooth in frequency. Least squares at every bin k gives the response g_0 and,
from the residual, its noise. Nonlinear distortion is part of that noise; only periodic excitation could separate them.
If a reference is given, input and output are both regressed on it and the response is their ratio, so that feedback of
noise by a controller causes no bias.

.. [1] J. Schoukens, G. Vandersteen, K. Barbé, R. Pintelon, "Nonparametric preprocessing in system identification: a
   powerful tool", European Journal of Control 15, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from ..._errors import IdentificationError

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
        raise IdentificationError("found a signal that stays or lacks samples, expected ones that move")
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
