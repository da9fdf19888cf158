"""Torque of known muscles at a knee, and trials of it as a study would give them."""

import numpy as np

from pellucid.estimators.muscle_source import MuscleSource
from pellucid.estimators.torque_trial import TorqueTrial
from pellucid.fit.muscles.muscle_calibration import MuscleProblem
from pellucid.models.muscle_geometry import muscle_table

MUSCLES = ("rectus_femoris", "vastus_lateralis", "vastus_medialis", "biceps_femoris_long", "semimembranosus")
FS = 100.0


def envelopes(seconds, *, seed=0, muscles=MUSCLES):
    """Bursts of each muscle, in [0, 1]."""
    rng, time = np.random.default_rng(seed), np.arange(round(seconds * FS)) / FS
    made = {}
    for muscle in muscles:
        x = np.zeros(len(time))
        for centre in np.arange(0.4, seconds, 0.8) + rng.uniform(-0.2, 0.2):
            x += rng.uniform(0.2, 0.9) * np.exp(-(((time - centre) / 0.12) ** 2))
        made[muscle] = np.clip(x, 0.0, 1.0)
    return made


def angles(seconds, *, seed=0):
    """Hip and knee in the geometry's signs [rad]."""
    rng, time = np.random.default_rng(100 + seed), np.arange(round(seconds * FS)) / FS
    a, b, c = rng.uniform(0.0, 2.0 * np.pi, 3)
    knee = -0.7 + 0.4 * np.sin(2.0 * np.pi * 0.6 * time + a) + 0.15 * np.sin(2.0 * np.pi * 1.1 * time + b)
    return {"hip": 0.4 + 0.3 * np.sin(2.0 * np.pi * 0.5 * time + c), "knee": knee}


def source():
    return MuscleSource(muscle_table().constants)


def trial(name="a", *, seconds=8.0, seed=0, noise=0.5, group="", heldout=False, true=None, muscles=MUSCLES):
    """A trial whose torque the muscles made, with `noise` [N m] on it; `true` changes numbers of a problem's names."""
    from pellucid.estimators.muscle_trials import driven_muscles, muscle_samples

    made = TorqueTrial(
        name=name,
        joint="knee",
        time=np.arange(round(seconds * FS)) / FS,
        envelopes=envelopes(seconds, seed=seed, muscles=muscles),
        angles=angles(seconds, seed=seed),
        torque=np.zeros(round(seconds * FS)),
        group=group,
        heldout=heldout,
        checksum=name,
        muscles=source(),
    )
    across = driven_muscles([made])
    samples, own = muscle_samples([made], muscles=[m.name for m in across])
    samples.torque[:] = np.linspace(0.0, 1.0, len(samples.torque))  # a problem wants a torque that changes
    problem = MuscleProblem(across, samples)
    values = problem.expected.copy()
    for key, value in (true or {}).items():
        values[problem.names.index(key)] = value
    torque = problem.torque(problem.deviations(values))[own[0]]
    made.torque[:] = torque + noise * np.random.default_rng(7 + seed).standard_normal(len(torque))
    return made


__all__ = ["FS", "MUSCLES", "angles", "envelopes", "source", "trial"]
