"""Delay of a causal EMG chain, computed from its filters' coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ChainDelay:
    """Parts of a causal chain's delay."""

    carrier: float  # delay of the filters before rectification, at the carrier's frequency [s]
    envelope: float  # delay of the filters after rectification, for slow changes [s]
    advance: float  # time by which EMG is shifted on purpose [s]

    @property
    def filters(self) -> float:
        """Delay of all filters [s]."""
        return self.carrier + self.envelope


def group_delay(sos: np.ndarray, frequency: float, fs: float) -> float:
    """Return the group delay of second-order sections at one frequency [s], in closed form.

    Each polynomial p(z) = p0 + p1/z + p2/z² has the delay Re(sum k pk z^-k / sum pk z^-k); a numerator counts, a
    denominator counts against.

    `sos` (k, 6); `frequency`, `fs` [Hz]; gives [s].
    """
    powers = np.exp(-2j * np.pi * frequency / fs * np.arange(3))
    steps = np.arange(3)

    def delay(p: np.ndarray) -> float:
        return float(np.real(np.sum(steps * p * powers) / np.sum(p * powers)))

    return sum(delay(row[:3]) - delay(row[3:]) for row in np.asarray(sos)) / fs
