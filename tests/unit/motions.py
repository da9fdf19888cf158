"""Noise-free or noisy motions of a known joint, for the tests of identification."""

import numpy as np

from pellucid import _core
from pellucid.models.joint import NAMES, PARAMETER_INDEX
from pellucid.numerics.motion import Filtering, Motion

TRUTH = {
    "inertia": 0.08,
    "gravity_sine": 3.0,
    "offset": 0.1,
    "coulomb_positive": 0.5,
    "coulomb_negative": 0.5,
    "viscous_positive": 0.2,
    "viscous_negative": 0.2,
}


def vector_of(**changes):
    vector = np.zeros(len(NAMES))
    for name, value in (TRUTH | changes).items():
        vector[PARAMETER_INDEX[name]] = value
    return vector


def motion_of(
    vector, *, name="one", split="fitted", seed=1, effort_sd=0.0, seconds=20.0, fs=200.0, gain=1.0, payload=(0.0, 0.0)
):
    """A multisine motion with exact velocity and acceleration, and the effort it takes."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * fs)) / fs
    k = np.arange(1, 7)
    w = 2.0 * np.pi * 0.15 * k
    a, phase = 0.5 / k, rng.uniform(0.0, 2.0 * np.pi, len(k))
    angle = time[:, None] * w + phase
    q, v, acc = np.sin(angle) @ a, np.cos(angle) @ (a * w), -np.sin(angle) @ (a * w**2)
    effort = _core.inverse_dynamics(vector, q, v, acc)
    mass, distance = payload
    effort = effort + mass * distance * (distance * acc + 9.80665 * np.sin(q))
    effort = (effort + effort_sd * rng.standard_normal(len(q))) / gain
    return Motion(
        recording=name,
        split=split,
        fs=fs,
        time=time,
        position=q,
        velocity=v,
        acceleration=acc,
        effort=effort,
        filtering=Filtering(None),
        raw_position=q,
        command=effort,
        payload=payload,
    )
