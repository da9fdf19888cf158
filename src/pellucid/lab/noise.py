"""What is random over time: noise, white or coloured, and paths that wander between two ends."""

from __future__ import annotations

import numpy as np


def draw_noise(shape: tuple[int, ...], sd: float, memory: float, fs: float, rng: np.random.Generator) -> np.ndarray:
    """Gaussian noise, white or first-order coloured, of standard deviation `sd` along the last axis of `shape`.
    `memory` [s]; `fs` [Hz]."""
    white = rng.standard_normal(shape)
    if memory <= 0.0:
        return sd * white
    from scipy.signal import lfilter

    rho = float(np.exp(-1.0 / (memory * fs)))
    start = white[..., :1] * rho
    return sd * lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], white, zi=start)[0]


def draw_wandering_path(n: int, memory: float, fs: float, rng: np.random.Generator) -> np.ndarray:
    """A smooth random path, uniform over 0 to 1 in the long run. `memory`, `fs` [s], [Hz]; gives (n,)."""
    from scipy.signal import oaconvolve
    from scipy.special import ndtr

    reach = round(4.0 * memory * fs)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (memory * fs)) ** 2)
    path = oaconvolve(rng.standard_normal(n + 2 * reach), bell / np.sqrt(np.sum(bell**2)), mode="valid")
    return ndtr(path)
