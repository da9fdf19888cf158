"""Random signals over time: white or coloured noise, and smooth random paths."""

from __future__ import annotations

import numpy as np


def draw_noise(shape: tuple[int, ...], sd: float, memory: float, fs: float, rng: np.random.Generator) -> np.ndarray:
    """Draw Gaussian noise of standard deviation `sd`, with time along the last axis of `shape`.

    The noise is first-order coloured with the correlation time `memory` [s], or white where that is 0; `fs` is the
    sampling rate [Hz].
    """
    white = rng.standard_normal(shape)
    if memory <= 0.0:
        return sd * white
    from scipy.signal import lfilter

    rho = float(np.exp(-1.0 / (memory * fs)))
    start = white[..., :1] * rho
    return sd * lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], white, zi=start)[0]


def draw_wandering_path(n: int, memory: float, fs: float, rng: np.random.Generator) -> np.ndarray:
    """Draw a smooth random path, shape (n,), whose values are uniformly distributed over 0 to 1 in the long run.

    White noise is smoothed by a Gaussian bell of standard deviation `memory` [s] and mapped by the normal distribution
    function; `fs` is the sampling rate [Hz].
    """
    from scipy.signal import oaconvolve
    from scipy.special import ndtr

    reach = round(4.0 * memory * fs)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (memory * fs)) ** 2)
    path = oaconvolve(rng.standard_normal(n + 2 * reach), kernel / np.sqrt(np.sum(kernel**2)), mode="valid")
    return ndtr(path)
