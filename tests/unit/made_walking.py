"""Envelopes and angles of someone who walks, each stride a little different from the last."""

from dataclasses import replace

import numpy as np

from pellucid.emg.estimators.torque_trial import TorqueTrial

FS = 100.0
MUSCLES = ("soleus", "tibialis", "vastus", "hamstring", "rectus")
PEAKS = np.array([0.45, 0.05, 0.15, 0.9, 0.6])  # Of the stride, at which each is most active
TOPS = np.array([0.1, 0.25, 0.05, 0.4, 0.03])


def walking(seed, seconds=20.0, cadence=0.9, strength=1.0):
    """Strides whose envelopes are bursts at a phase of their own, each a little different from the last."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / FS)
    phase = cadence * time
    angles = {"knee": 0.5 * np.sin(2 * np.pi * phase) + 0.2 * np.sin(4 * np.pi * phase + 1.0),
              "ankle": 0.3 * np.cos(2 * np.pi * phase)}  # fmt: skip
    strides = np.exp(0.2 * rng.standard_normal((len(MUSCLES), int(phase[-1]) + 2)))
    away = (phase[None] - PEAKS[:, None] + 0.5) % 1.0 - 0.5
    burst = np.exp(-((away / 0.12) ** 2)) * strides[:, np.round(phase - 0.5).astype(int)]
    envelopes = TOPS[:, None] * (0.02 + strength * burst) + 1e-4 * rng.uniform(size=(len(MUSCLES), len(time)))
    return TorqueTrial("walk", "knee", time, dict(zip(MUSCLES, envelopes, strict=True)), angles, np.zeros(len(time)))


def changed(trial, **envelopes):
    return replace(trial, envelopes={**trial.envelopes, **envelopes})
