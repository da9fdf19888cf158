r"""A frequency response from any recording, without a model: response and transient are smooth over a few bins [1]_.

.. math::  Y(k + r) = \Big(\sum_s g_s r^s\Big)\,U(k + r) + \sum_s t_s r^s + V(k + r), \qquad |r| \le n

Least squares at every bin k; g_0 is the response there, the residual its noise. What is not linear is part of that
noise: without periods nothing tells them apart. With a reference both signals are explained by it and their ratio is
the response, so that a controller's feedback of noise biases nothing.

.. [1] J. Schoukens, G. Vandersteen, K. Barbé, R. Pintelon, "Nonparametric preprocessing in system identification: a
   powerful tool", European Journal of Control 15, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from ..._errors import IdentificationError

DEGREE = 2
"""Of the local polynomials."""

SPARE = 10
"""Complex equations beyond unknowns at each bin: those that tell the noise."""

SHOWN, JUDGED = 400, 4000
"""Bins at which a response is kept at most, evenly over the logarithm of frequency, and at which powers are summed,
evenly over frequency."""

EXCITED = 1e-4
"""A bin whose surroundings have less than this share of the strongest surroundings' power shows no response."""


@dataclass(frozen=True, eq=False)
class LocalResponse:
    """A frequency response, and how much of the output it does not explain, noise and distortion together."""

    frequency: np.ndarray  # (k,) [Hz]
    response: np.ndarray  # (k,) Complex, output unit per input unit
    variance: np.ndarray  # (k,) Of the response, complex: E|G - G0|^2
    input_power: np.ndarray  # (k,) Mean |U|^2 around each bin
    missed_power: np.ndarray  # (k,) Of |Y|^2 at a bin, what no linear model explains
    freedom: int  # Complex degrees of freedom of `missed_power` at a bin
    fit: float  # How much of the output is explained where the input excites it [%]; no model's bound: bins are few
    closed_loop: bool  # Whether a reference explains both signals

    def radius(self, confidence: float = 0.95) -> np.ndarray:
        """Of a disk around each response that holds the true one with a confidence, shape (k,)."""
        return np.sqrt(self.variance * f_distribution.ppf(confidence, 2, 2 * self.freedom))


def local_response(
    input: np.ndarray, output: np.ndarray, rate: float, *, reference: np.ndarray | None = None
) -> LocalResponse:
    """The response from evenly sampled signals, shape (n,), at a `rate` [Hz]; `reference` (n,) where a controller
    closes the loop."""
    signals = [np.asarray(x, float) for x in (input, output)]
    cause = signals[0] if reference is None else np.asarray(reference, float)
    half = -(-(2 * (DEGREE + 1) + SPARE - 1) // 2)
    n = len(cause)
    if n < 8 * half:
        raise IdentificationError(f"found {n} samples, expected at least {8 * half} for a frequency response")
    if any(not np.isfinite(x).all() or np.ptp(x) == 0.0 for x in (cause, *signals)):
        raise IdentificationError("found a signal that stays or lacks samples, expected ones that move")
    # A bin's number is its frequency times n / rate; the mean is no part of a response.
    driving = np.fft.rfft(cause - cause.mean()) / n
    both = np.stack([np.fft.rfft(x - x.mean()) / n for x in signals], axis=1)
    power = np.convolve(np.abs(driving) ** 2, np.ones(2 * half + 1) / (2 * half + 1), "same")
    inside = np.arange(half + 1, len(driving) - half)
    excited = inside[power[inside] > EXCITED * power[inside].max()]
    offset = np.arange(-half, half + 1)

    def at(bins: np.ndarray) -> tuple[np.ndarray, ...]:
        return _local(driving, both, power, bins, offset)

    # What an input excites is told by the input, also where a reference drives it.
    _, _, missed = at(excited[:: -(-len(excited) // JUDGED)])
    judged = excited[:: -(-len(excited) // JUDGED), None] + offset
    whole = np.sum(np.mean(np.abs(both[judged][:, :, 1]) ** 2, axis=1))
    if len(excited) > SHOWN:
        wanted = np.searchsorted(excited, np.geomspace(excited[0], excited[-1], SHOWN))
        excited = np.unique(excited[wanted.clip(max=len(excited) - 1)])
    response, spread, noise = at(excited)
    return LocalResponse(
        frequency=excited * rate / n,
        response=response,
        variance=noise * spread,
        input_power=np.mean(np.abs(both[excited[:, None] + offset][:, :, 0]) ** 2, axis=1),
        missed_power=noise,
        freedom=len(offset) - 2 * (DEGREE + 1),
        fit=float(100.0 * (1.0 - np.sqrt(min(np.sum(missed) / whole, 1.0)))),
        closed_loop=reference is not None,
    )


def _local(
    driving: np.ndarray, both: np.ndarray, power: np.ndarray, centres: np.ndarray, offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At bins, each (k,): the response, by how much its variance is the noise's, and the noise's variance."""
    bins = centres[:, None] + offset
    powers = (offset / offset[-1])[:, None] ** np.arange(DEGREE + 1)
    # Scaled by the cause's size around the bin, so that both halves of the columns weigh alike.
    scale = np.sqrt(power[centres])[:, None]
    columns = np.concatenate(
        [(driving[bins] / scale)[:, :, None] * powers, np.broadcast_to(powers, (*bins.shape, DEGREE + 1))], axis=2
    )
    q, r = np.linalg.qr(columns)
    projected = np.conj(np.swapaxes(q, 1, 2)) @ both[bins]
    inverse = np.linalg.pinv(r)
    found = (inverse[:, :1] @ projected)[:, 0] / scale  # per unit of the cause: input and output
    residual = both[bins] - q @ projected
    response = found[:, 1] / found[:, 0]
    missed = residual[:, :, 1] - response[:, None] * residual[:, :, 0]
    noise = np.sum(np.abs(missed) ** 2, axis=1) / (len(offset) - 2 * (DEGREE + 1))
    spread = np.sum(np.abs(inverse[:, 0]) ** 2, axis=1) / scale[:, 0] ** 2 / np.abs(found[:, 0]) ** 2
    return response, spread, noise
