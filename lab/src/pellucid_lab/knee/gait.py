"""Knee angles of walking: recorded on a treadmill, or generated where the recordings are not on this machine.

A wearer of the virtual orthosis moves the shank along these angles while the thigh rests. The motion has the pace and
the speeds of gait, but neither contact with the ground nor a moving thigh.
"""

from __future__ import annotations

import numpy as np

from pellucid._errors import DatasetError
from pellucid.numerics.filters import zero_phase_lowpass
from pellucid.study.datasets import recorded_walking

GAIT_LOWPASS_HZ = 6.0
"""Corner of the low-pass filter for recorded walking [Hz]; a knee moves more slowly than that."""

FADE_IN_S = 2.0
"""Time in which a wearer reaches the full amplitude of walking [s]."""

STRIDE_DURATION_S = 1.15
"""Mean duration of a stride of generated walking [s]."""

STRIDE_DURATION_SD_S = 0.015
"""Standard deviation of a stride's duration from one to the next, in generated walking [s]."""

FLEXION_BUMPS = ((np.radians(15.0), 0.14, 0.08), (np.radians(58.0), 0.72, 0.10))
"""Flexion of stance and of swing in generated walking: amplitude [rad], time and width as shares of a stride [1]."""


def walking(rate: float, duration: float, rng: np.random.Generator) -> tuple[np.ndarray, str]:
    """Return knee flexion in walking, shape (n,) [rad], and its source in words.

    The path is sampled at `rate` [Hz] for `duration` [s]. It begins at rest at its mean.
    """
    n = round(duration * rate)
    try:
        fs, angle = recorded_walking()
        source = "recorded on a treadmill"
    except DatasetError:
        fs, angle = rate, generate_walking(rate, 2.0 * duration, rng)
        source = "generated"
    angle = zero_phase_lowpass(angle, GAIT_LOWPASS_HZ, 2, fs)
    start = rng.uniform(0.0, max((len(angle) - 1) / fs - duration, 0.0))
    seconds = np.arange(n) / rate
    path = np.interp(start + seconds, np.arange(len(angle)) / fs, angle)
    share = np.clip(seconds / FADE_IN_S, 0.0, 1.0)
    mean = float(np.mean(path))
    return mean + share**2 * (3.0 - 2.0 * share) * (path - mean), source


def generate_walking(rate: float, duration: float, rng: np.random.Generator) -> np.ndarray:
    """Return the knee flexion of generated strides at a `rate` [Hz] for a `duration` [s], shape (n,) [rad]."""
    strides = STRIDE_DURATION_S + STRIDE_DURATION_SD_S * rng.standard_normal(int(duration / STRIDE_DURATION_S) + 3)
    ends = np.concatenate([[0.0], np.cumsum(strides)])
    phase = np.interp(np.arange(round(duration * rate)) / rate, ends, np.arange(len(ends))) % 1.0
    angle = np.full(len(phase), np.radians(5.0))
    for size, when, width in FLEXION_BUMPS:
        off = (phase - when + 0.5) % 1.0 - 0.5
        angle += size * np.exp(-0.5 * (off / width) ** 2)
    return angle
