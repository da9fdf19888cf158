"""Torque of known muscles at a knee, and trials of it as a study would give them."""

import numpy as np

from pellucid.emg.estimators.torque_trial import MuscleSource, TorqueTrial
from pellucid.emg.fit.muscle_calibration import MuscleProblem
from pellucid.emg.models.muscle_geometry import muscle_table

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
    from pellucid.emg.estimators.muscle_trials import find_driven_muscles, make_muscle_samples

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
    across = find_driven_muscles([made])
    samples, own = make_muscle_samples([made], muscles=[m.name for m in across])
    samples.torque[:] = np.linspace(0.0, 1.0, len(samples.torque))  # a problem wants a torque that changes
    problem = MuscleProblem(across, samples)
    values = problem.expected.copy()
    for key, value in (true or {}).items():
        values[problem.names.index(key)] = value
    torque = problem.torque(problem.deviations(values))[own[0]]
    made.torque[:] = torque + noise * np.random.default_rng(7 + seed).standard_normal(len(torque))
    return made


LEG = (*MUSCLES, "gastrocnemius_medialis", "soleus", "tibialis_anterior")


def across(name="a", *, seconds=10.0, seed=0, noise=1.0, true=None, early=0.0, heldout=False):
    """A recording's trials at knee and ankle, whose torques one set of muscles made, with coloured `noise` [N m] on
    them; `true` changes numbers of a problem's names, or gives the whole z of a problem; `early` is how far the EMG's
    stream runs ahead [s]."""
    from pellucid.emg.estimators.muscle_trials import find_driven_muscles_across, make_muscle_samples_across
    from pellucid.emg.fit.muscle_calibration import Timing, coupled_priors

    count, pad = round(seconds * FS), 60
    driven = envelopes(seconds + 2 * pad / FS, seed=seed, muscles=LEG)
    shift = round(early * FS)

    def made(joint, torque, lag):
        return TorqueTrial(
            name=name,
            joint=joint,
            time=np.arange(count) / FS,
            envelopes={muscle: x[pad + lag : pad + lag + count] for muscle, x in driven.items()},
            angles=leg_angles(seconds, seed=seed),
            torque=torque,
            heldout=heldout,
            checksum=name,
            muscles=source(),
        )

    ramp = np.linspace(0.0, 1.0, count)
    trials = {joint: [made(joint, ramp, 0)] for joint in ("knee", "ankle")}
    muscles = find_driven_muscles_across(trials)
    samples, own = make_muscle_samples_across(trials, muscles=[m.name for m in muscles])
    priors, hold = coupled_priors(muscles, Timing(0.04), 1.0 / FS)
    problem = MuscleProblem(muscles, samples, priors=priors, hold=hold)
    values = problem.expected.copy()
    if callable(true):
        values = problem.values(true(problem))
    for key, value in ({} if callable(true) else true or {}).items():
        values[problem.names.index(key)] = value
    torque = problem.torque(problem.deviations(values))[:, own[0]]
    drawn = np.random.default_rng(70 + seed).standard_normal((2, count + 10))
    torque = torque + noise * np.array([np.convolve(x, np.ones(11) / np.sqrt(11.0), "valid") for x in drawn])
    return {joint: made(joint, row, shift) for joint, row in zip(("knee", "ankle"), torque, strict=True)}


def leg_angles(seconds, *, seed=0):
    """Hip, knee and ankle in the geometry's signs [rad]."""
    rng, time = np.random.default_rng(200 + seed), np.arange(round(seconds * FS)) / FS
    a, b = rng.uniform(0.0, 2.0 * np.pi, 2)
    ankle = 0.15 * np.sin(2.0 * np.pi * 0.7 * time + a) + 0.1 * np.sin(2.0 * np.pi * 1.3 * time + b)
    return {**angles(seconds, seed=seed), "ankle": ankle}


__all__ = ["FS", "LEG", "MUSCLES", "across", "angles", "envelopes", "leg_angles", "source", "trial"]
