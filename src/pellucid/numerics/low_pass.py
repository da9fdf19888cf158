"""Designs of digital low-passes as second-order sections, the same numbers as scipy.signal's, which loads all of
scipy.stats: a second at every start [1]_.

.. [1] A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 3rd ed., 2010, section 7.2 (bilinear transform).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np


def butterworth(order: int, cutoff: float) -> np.ndarray:
    """Sections (k, 6) of a Butterworth low-pass of an `order`, -3 dB at its `cutoff` [half the sampling rate]."""
    return _digital(-np.exp(1j * np.pi * _turns(order) / (2 * order)), 1.0, cutoff)


def chebyshev(order: int, ripple: float, cutoff: float) -> np.ndarray:
    """Sections (k, 6) of a Chebyshev low-pass of an `order`, with a `ripple` [dB] in its pass band, which ends
    at `cutoff` [half the sampling rate]."""
    eps = np.sqrt(10 ** (0.1 * ripple) - 1.0)
    poles = -np.sinh(1.0 / order * np.arcsinh(1 / eps) + 1j * (np.pi * _turns(order) / (2 * order)))
    gain = np.prod(-poles).real
    return _digital(poles, gain if order % 2 else gain / np.sqrt(1 + eps * eps), cutoff)


def butterworth_band(order: int, low: float, high: float) -> np.ndarray:
    """Sections (k, 6) of a Butterworth band-pass of twice an `order`, -3 dB at both ends [half the sampling rate]."""
    low, high = (4.0 * np.tan(np.pi * edge / 2.0) for edge in (low, high))
    half = -np.exp(1j * np.pi * _turns(order) / (2 * order)) * (high - low) / 2.0
    root = np.sqrt(half**2 - low * high)
    poles = np.concatenate([half + root, half - root])
    gain = (4.0 * (high - low)) ** order * (1.0 / np.prod(4.0 - poles)).real
    sections = _sections((4.0 + poles) / (4.0 - poles), np.repeat([1.0, -1.0], order))
    sections[0, :3] *= gain
    return sections


def settled(sections: np.ndarray) -> np.ndarray:
    """The state (k, 2) of each of the `sections` (k, 6) in which a constant input of 1 leaves the cascade."""
    states, level = np.empty((len(sections), 2)), 1.0
    for state, section in zip(states, sections, strict=True):
        b, (_, a1, a2) = section[:3], section[3:]
        gain = b.sum() / (1.0 + a1 + a2)  # for poles near 1 this sum is exact, unlike the pivots of a linear solver
        state[:] = level * (gain - b[0]), level * (b[2] - a2 * gain)
        level *= gain
    return states


def filter_settled(section: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Samples, (n,), run through one section, (6,), as if the first one had lasted: no step has to settle."""
    return _filtered(np.asarray(section, float).tobytes(), np.asarray(samples, float).tobytes()).copy()


# A fit asks for the features of the same few trials again and again.
@lru_cache(maxsize=64)
def _filtered(section: bytes, samples: bytes) -> np.ndarray:
    own = np.frombuffer(section)
    b0, b1, b2, _, a1, a2 = own.tolist()
    x = np.frombuffer(samples).tolist()
    first, second = (settled(own[None, :])[0] * x[0]).tolist()
    made = []
    for each in x:
        y = b0 * each + first
        first = b1 * each - a1 * y + second
        second = b2 * each - a2 * y
        made.append(y)
    return np.array(made)


def _turns(order: int) -> np.ndarray:
    """Where an analog prototype's poles lie, from the negative real axis [pi / 2 / order rad]."""
    return np.arange(-order + 1, order, 2)


def _digital(poles: np.ndarray, gain: float, cutoff: float) -> np.ndarray:
    """The bilinear transform of an analog low-pass without zeros and with a cutoff of 1 rad/s."""
    warped = 4.0 * np.tan(np.pi * cutoff / 2.0)
    poles = warped * poles
    gain = gain * warped ** len(poles) * (1.0 / np.prod(4.0 - poles)).real
    sections = _sections((4.0 + poles) / (4.0 - poles), np.full(len(poles), -1.0))
    sections[0, :3] *= gain
    return sections


def _sections(poles: np.ndarray, zeros: np.ndarray) -> np.ndarray:
    """Each pair of poles with the zeros nearest to it, the pair nearest to the unit circle last: rounding then does the
    least harm. An odd order takes a pole and a zero at 0 as well."""
    odd = len(poles) % 2
    zeros = np.concatenate([zeros, np.zeros(odd)])
    left = np.concatenate([poles[poles.imag > 0.0], poles[poles.imag == 0.0], np.zeros(odd)])
    sections: list[list[float]] = []
    while len(left):
        at = np.argmin(np.abs(1.0 - np.abs(left)))
        pole, left = left[at], np.delete(left, at)
        other = pole.conj()
        if pole.imag == 0.0:
            at = np.flatnonzero(left.imag == 0.0)[0]
            other, left = left[at], np.delete(left, at)
        nearest = np.argsort(np.abs(zeros - pole))[:2]
        pair, zeros = zeros[nearest], np.delete(zeros, nearest)
        sections.insert(0, [1.0, -pair.sum(), pair.prod(), 1.0, -(pole + other).real, (pole * other).real])
    return np.array(sections)
