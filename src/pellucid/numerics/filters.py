"""Zero-phase filters and derivatives for identification. Both sides of a regression pass through the same ones [1]_.

.. [1] M. Gautier, "Dynamic identification of robots with power model", Proc. IEEE ICRA, 1997 (parallel filtering).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .. import _core
from .low_pass import butterworth, chebyshev, settled


def zero_phase_lowpass(samples: np.ndarray, cutoff: float, order: int, fs: float) -> np.ndarray:
    """Butterworth low-pass run forwards and backwards along axis 0: no delay, twice the attenuation. `samples` (n,);
    `cutoff`, `fs` [Hz]."""
    if not 0.0 < cutoff < fs / 2.0:
        raise ValueError(
            f"found a low-pass of {cutoff:g} Hz, expected above 0 and below half the sampling rate, {fs / 2:g} Hz"
        )
    low_pass = _butterworth(order, 2.0 * cutoff / fs)
    padding = 3 * (2 * len(low_pass.sections) + 1)
    if len(samples) <= padding:
        raise ValueError(
            f"found {len(samples)} samples, expected more than {padding} for a zero-phase filter of order {order}"
        )
    return low_pass(samples)


def sliding_mean(samples: np.ndarray, count: int) -> np.ndarray:
    """Centred mean over `count` samples along axis 0, over fewer at the borders. `samples` (n,) or (n, k); an even
    `count` gives both outermost samples half their weight, so that nothing is delayed."""
    if not 1 <= count <= len(samples):
        raise ValueError(
            f"found a sliding mean over {count} samples, expected at least 1 and at most the {len(samples)} recorded"
        )
    weights = np.ones(count) if count % 2 else np.concatenate([[0.5], np.ones(count - 1), [0.5]])
    half = len(weights) // 2
    columns = np.reshape(np.asarray(samples, float), (len(samples), -1))
    # Without their mean the samples' sum does not grow, and differences of it stay exact.
    centre = columns.mean(axis=0)
    total = _windowed(np.pad(columns - centre, ((half, half), (0, 0))), weights)
    weight = _windowed(np.pad(np.ones((len(samples), 1)), ((half, half), (0, 0))), weights)
    return (total / weight + centre).reshape(np.shape(samples))


def _windowed(padded: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted sums of (n + len(weights) - 1, k) samples, (n, k), where all weights but the outermost are equal."""
    sums = np.concatenate([np.zeros((1, padded.shape[1])), np.cumsum(padded, axis=0)])
    many, n = len(weights), len(padded) - len(weights) + 1
    whole = sums[many : many + n] - sums[:n]
    return whole - (1.0 - weights[0]) * (padded[:n] + padded[many - 1 : many - 1 + n])


@dataclass(frozen=True)
class _BothWays:
    """A cascade of `sections` (k, 6), its `settled` states (k, 2), and how many samples it adds at each border."""

    sections: np.ndarray
    settled: np.ndarray
    padding: int

    def __call__(self, samples: np.ndarray) -> np.ndarray:
        """Samples, (n,) or (n, k), run through forwards and backwards along axis 0."""
        columns = np.reshape(samples, (len(samples), -1))
        return _core.zero_phase(self.sections, self.settled, columns, self.padding).reshape(np.shape(samples))


def _both_ways(sections: np.ndarray) -> _BothWays:
    # An odd order fills its last section with a pole and a zero at 0, which need no border.
    filled = min((sections[:, 2] == 0.0).sum(), (sections[:, 5] == 0.0).sum())
    return _BothWays(sections, settled(sections), 3 * int(2 * len(sections) + 1 - filled))


@lru_cache(maxsize=32)
def _butterworth(order: int, cutoff: float) -> _BothWays:
    return _both_ways(butterworth(order, cutoff))


@lru_cache(maxsize=32)
def _anti_aliasing(factor: int) -> _BothWays:
    return _both_ways(chebyshev(8, 0.05, 0.8 / factor))


def local_cubic(samples: np.ndarray, window: int) -> np.ndarray:
    """Return at each sample the cubic that fits the `window` samples around it best, (n,), an odd number of them.

    At either border it is the cubic of the outermost window. The numbers are those of scipy.signal.savgol_filter, which
    loads all of scipy.stats.
    """
    half = window // 2
    powers = np.vander(np.arange(-half, half + 1) / half, 4)
    weights = powers @ np.linalg.pinv(powers)
    smooth = np.convolve(samples, weights[half][::-1], mode="same")
    smooth[:half], smooth[-half:] = weights[:half] @ samples[:window], weights[-half:] @ samples[-window:]
    return smooth


def central_difference(samples: np.ndarray, fs: float) -> np.ndarray:
    """Derivative by central differences, one-sided at the two borders. `samples` (n,) or (n, k); `fs` [Hz]."""
    return np.gradient(samples, 1.0 / fs, axis=0)


def decimate(samples: np.ndarray, factor: int) -> np.ndarray:
    """Keep one sample in `factor` along axis 0, after a zero-phase anti-aliasing filter (Chebyshev I, order 8, 0.8
    of the new Nyquist frequency). Both sides of a regression must pass through it. `samples` (n,); gives (ceil(n
    / factor),)."""
    return samples if factor == 1 else anti_aliased(samples, factor)[::factor]


def anti_aliased(samples: np.ndarray, factor: int) -> np.ndarray:
    """`samples`, (n,) or (n, k), without what one sample in `factor` could not tell; the same number of them."""
    return samples if factor == 1 else _anti_aliasing(factor)(samples)


def runs(mask: np.ndarray) -> list[slice]:
    """Stretches of consecutive True samples, as slices, in order. `mask` (n,)."""
    padded = np.zeros(len(mask) + 2, bool)
    padded[1:-1] = mask
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def lowpass_memory(order: int, cutoff: float, fs: float) -> int:
    """Samples after which `zero_phase_lowpass` has forgotten a border to one part in 10^13; `cutoff`, `fs` [Hz]."""
    return _memory(butterworth(order, 2.0 * cutoff / fs))


def decimation_memory(factor: int) -> int:
    """The same of `decimate`."""
    return 0 if factor == 1 else _memory(chebyshev(8, 0.05, 0.8 / factor))


def _memory(sections: np.ndarray) -> int:
    slowest = max(abs(root) for section in sections for root in np.roots(section[3:]))
    return int(np.ceil(np.log(1e-13) / np.log(slowest)))
