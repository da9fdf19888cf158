"""How late a causal EMG chain is: by its coefficients, and by the lag that best aligns envelope and amplitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import signal

if TYPE_CHECKING:
    from .emg_chain import EmgChain


@dataclass(frozen=True)
class ChainDelay:
    """Where a causal chain's delay comes from.

    Attributes
    ----------
    carrier : float
        Of the filters before rectification, at the carrier's frequency [s].
    envelope : float
        Of the filters after it, for slow changes [s].
    advance : float
        By which EMG is taken early on purpose [s].
    """

    carrier: float
    envelope: float
    advance: float

    @property
    def filters(self) -> float:
        """What filtering costs [s]."""
        return self.carrier + self.envelope


def group_delay(sos: np.ndarray, frequency: float, fs: float) -> float:
    """Group delay of second-order sections at one frequency, in closed form.

    Each polynomial p(z) = p0 + p1/z + p2/z² has the delay Re(sum k pk z^-k / sum pk z^-k); a numerator counts, a
    denominator counts against.

    Parameters
    ----------
    sos : ndarray, shape (k, 6)
        Sections, none of which may have a zero at the frequency.
    frequency, fs : float
        [Hz]

    Returns
    -------
    float
        [s]
    """
    powers = np.exp(-2j * np.pi * frequency / fs * np.arange(3))
    steps = np.arange(3)

    def delay(p: np.ndarray) -> float:
        return float(np.real(np.sum(steps * p * powers) / np.sum(p * powers)))

    return sum(delay(row[:3]) - delay(row[3:]) for row in np.asarray(sos)) / fs


def aligning_lag(chain: EmgChain, fs: float, *, seconds: float = 120.0, bandwidth: float = 1.0, seed: int = 0) -> float:
    """The lag at which a causal envelope correlates best with the amplitude that modulated its EMG.

    EMG is noise whose amplitude is a slow random signal; the chain runs causally on it.

    Parameters
    ----------
    chain : EmgChain
    fs : float
        [Hz]
    seconds : float
        Length of the made-up EMG [s].
    bandwidth : float
        Of the amplitude [Hz].
    seed : int

    Returns
    -------
    float
        [s], to a sample.
    """
    rng = np.random.default_rng(seed)
    n = int(seconds * fs)
    slow = signal.sosfiltfilt(signal.butter(2, bandwidth, fs=fs, output="sos"), rng.standard_normal(n))
    amplitude = np.exp(slow / slow.std())
    envelope = chain.causal(amplitude * rng.standard_normal(n), fs, maximum=1.0)
    most = min(n // 4, int(1.0 * fs))
    a, e = amplitude - amplitude.mean(), envelope - envelope.mean()
    likeness = signal.correlate(e, a, method="fft")[n - 1 : n - 1 + most]
    return int(np.argmax(likeness)) / fs
