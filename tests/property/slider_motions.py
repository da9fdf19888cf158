"""Motions of a joint with a carriage made up from known parameters, without noise."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pellucid.joint.slider.slider_fit import SliderMotion

FS, LOWPASS, ORDER, DEAD_BAND = 100.0, 5.0, 4, 0.1
PLACES = (0.12, 0.16, 0.21, 0.27)
STEADY, SWEPT = ((0.75, 0.10), (0.04, 0.07)), ((0.4, 0.45), (0.2, 0.8), (0.08, 1.3))


def bare(slider: float, protocol: str, seed: int, seconds: float = 30.0, centre: float = 1.15) -> SliderMotion:
    """Slow enough for step 2, or fast enough for step 3, and no effort yet."""
    rng, t = np.random.default_rng(seed), np.arange(round(seconds * FS)) / FS
    q, v, a = np.full(len(t), centre), np.zeros(len(t)), np.zeros(len(t))
    for size, frequency in STEADY if protocol == "constant_velocity" else SWEPT:
        w, phase = 2.0 * np.pi * frequency, rng.uniform(0.0, 2.0 * np.pi)
        q += size * np.sin(w * t + phase)
        v += size * w * np.cos(w * t + phase)
        a -= size * w**2 * np.sin(w * t + phase)
    scored = np.abs(v) > DEAD_BAND
    scored[:50] = scored[-50:] = False
    return SliderMotion(
        recording=f"{protocol}_{slider}",
        protocol=protocol,
        split="fitted",
        slider=slider,
        fs=FS,
        position=q,
        velocity=v,
        acceleration=a,
        effort=np.zeros(len(t)),
        lowpass=LOWPASS,
        order=ORDER,
        scored=scored,
    )


def made_up(effort_of: Callable[[SliderMotion], np.ndarray], places=PLACES) -> list[SliderMotion]:
    """Both protocols at every place, with the effort that `effort_of` a motion gives."""
    protocols = ("constant_velocity", "swept_sine")
    motions = [bare(x, p, 10 * i + j) for i, x in enumerate(places) for j, p in enumerate(protocols)]
    return [replace(m, effort=np.asarray(effort_of(m), float)) for m in motions]
