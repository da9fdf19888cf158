"""How late a causal EMG chain is, by its coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ChainDelay:
    """Where a causal chain's delay comes from."""

    carrier: float  # Of the filters before rectification, at the carrier's frequency [s]
    envelope: float  # Of the filters after it, for slow changes [s]
    advance: float  # By which EMG is taken early on purpose [s]

    @property
    def filters(self) -> float:
        """What filtering costs [s]."""
        return self.carrier + self.envelope


def group_delay(sos: np.ndarray, frequency: float, fs: float) -> float:
    """Group delay of second-order sections at one frequency, in closed form.

    Each polynomial p(z) = p0 + p1/z + p2/z² has the delay Re(sum k pk z^-k / sum pk z^-k); a numerator counts, a
    denominator counts against.

    `sos` (k, 6); `frequency`, `fs` [Hz]; gives [s].
    """
    powers = np.exp(-2j * np.pi * frequency / fs * np.arange(3))
    steps = np.arange(3)

    def delay(p: np.ndarray) -> float:
        return float(np.real(np.sum(steps * p * powers) / np.sum(p * powers)))

    return sum(delay(row[:3]) - delay(row[3:]) for row in np.asarray(sos)) / fs
