"""The knee of somebody who walks: as it was recorded on a treadmill, or generated where that is not here.

A wearer of the virtual orthosis takes the shank through it while the thigh stays where it is: the pace and the speeds
of gait, without its ground and without its moving thigh.
"""

from __future__ import annotations

import numpy as np

from ..._errors import DatasetError
from ...datasets import recorded_walking
from ...signals.filters import zero_phase_lowpass

CUT_OFF = 6.0
"""Below which a knee moves in walking [Hz]."""

BEGIN = 2.0
"""In which a wearer gets going [s]."""

STRIDE, STRIDE_SPREAD = 1.15, 0.015
"""Of generated walking: how long a stride takes, and its standard deviation from one to the next [s]."""

BUMPS = ((np.radians(15.0), 0.14, 0.08), (np.radians(58.0), 0.72, 0.10))
"""Of generated walking: how far stance and swing flex the knee, when in a stride and how wide [rad], [1], [1]."""


def walking(rate: float, duration: float, rng: np.random.Generator) -> tuple[np.ndarray, str]:
    """A knee's flexion at a `rate` [Hz] for a duration [s], at rest in its mean at first, shape (n,) [rad]; and where
    it comes from, in words."""
    n = round(duration * rate)
    try:
        fs, angle = recorded_walking()
        source = "recorded on a treadmill"
    except DatasetError:
        fs, angle = rate, generated(rate, 2.0 * duration, rng)
        source = "generated"
    angle = zero_phase_lowpass(angle, CUT_OFF, 2, fs)
    late = rng.uniform(0.0, max((len(angle) - 1) / fs - duration, 0.0))
    seconds = np.arange(n) / rate
    path = np.interp(late + seconds, np.arange(len(angle)) / fs, angle)
    share = np.clip(seconds / BEGIN, 0.0, 1.0)
    mean = float(np.mean(path))
    return mean + share**2 * (3.0 - 2.0 * share) * (path - mean), source


def generated(rate: float, duration: float, rng: np.random.Generator) -> np.ndarray:
    """Strides one after another at a `rate` [Hz] for a duration [s], shape (n,) [rad]."""
    strides = STRIDE + STRIDE_SPREAD * rng.standard_normal(int(duration / STRIDE) + 3)
    ends = np.concatenate([[0.0], np.cumsum(strides)])
    phase = np.interp(np.arange(round(duration * rate)) / rate, ends, np.arange(len(ends))) % 1.0
    made = np.full(len(phase), np.radians(5.0))
    for size, when, width in BUMPS:
        off = (phase - when + 0.5) % 1.0 - 0.5
        made += size * np.exp(-0.5 * (off / width) ** 2)
    return made
