"""Motions of an arm: recorded from people in a robot of four joints, or generated where these recordings are missing.

Angles are abduction, flexion, internal rotation and elbow flexion, in this order, positive as named. Those of the
shoulder are successive rotations of the hanging arm: about an axis that points forwards, then one to the side, then
along the upper arm. The axes of the recorded people's robot follow each other in this order, so that its angles are
those of the rig.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from pellucid.study.datasets import RecordedMotion, recorded_motions

JOINTS = ("abduction", "flexion", "internal_rotation", "elbow_flexion")
"""Joints in the order of the chain, from the trunk outwards."""

MOTION_LOWPASS_HZ = 4.0
"""Corner of the low-pass filter for recorded motions [Hz].

People's joints move more slowly, and the recorded angles are steps of a fraction of a degree."""

PAUSE_S = 0.4
"""Rest between two motions, which the recordings lack and which is put back [s]."""

MAX_TRANSITION_SPEED_RAD_S = 1.2
"""Largest speed on the way from the end of one motion to the start of the next [rad/s]."""

REST_S = 1.0
"""Rest before the first motion and after the last [s]."""

GENERATED_REACHES = {"low": (0.15, 0.1, -0.3, 0.6), "high": (0.9, 1.3, 0.9, 2.0), "shortest": 0.8, "longest": 1.8}
"""Ranges of generated reaching: postures [rad] and durations of a movement [s]; recorded people stayed within them."""


@dataclass(frozen=True, eq=False)
class HumanMotion:
    """A motion of all four joints, smooth, at rest at both ends."""

    name: str
    source: str  # origin of the motion, in words
    rate: float  # sampling rate [Hz]
    position: np.ndarray = field(repr=False)  # (n, 4) [rad]

    @property
    def velocity(self) -> np.ndarray:
        """Return the velocity, shape (n, 4) [rad/s]."""
        return np.gradient(self.position, 1.0 / self.rate, axis=0)

    @property
    def acceleration(self) -> np.ndarray:
        """Return the acceleration, shape (n, 4) [rad/s^2]."""
        return np.gradient(self.velocity, 1.0 / self.rate, axis=0)

    @property
    def duration(self) -> float:
        """Return the duration [s]."""
        return len(self.position) / self.rate


def people() -> tuple[str, ...]:
    """Return the names of the recorded people; raise a DatasetError if the recordings are not on this machine."""
    return tuple(dict.fromkeys(motion.person for motion in recorded_motions(JOINTS)))


def recorded_motion(
    person: str, rate: float, *, repetition: int = 1, tasks: Collection[int] = (1, 2, 3, 4, 5, 6)
) -> HumanMotion:
    """Return one person's motions in a `repetition` of `tasks`, joined in order and smoothed, at a `rate` [Hz]."""
    own = [m for m in recorded_motions(JOINTS) if m.person == person and m.repetition == repetition and m.task in tasks]
    if not own:
        raise ValueError(f"person {person!r}, repetition {repetition}: no motion; known: {', '.join(people())}")
    stretches = [_join(list(of_task), rate) for _, of_task in groupby(own, key=lambda motion: motion.task)]
    return _smooth(f"{person}_{repetition}", f"recorded, {person}, repetition {repetition}", rate, stretches)


def _join(motions: list[RecordedMotion], rate: float) -> np.ndarray:
    """Return a task's motions at a `rate` [Hz] with rest between them, shape (n, 4) [rad]."""
    parts: list[np.ndarray] = []
    for motion in motions:
        time = np.arange(len(motion.angles)) / motion.rate
        fine = np.arange(round(time[-1] * rate)) / rate
        if parts:
            parts.append(_transition(parts[-1][-1], motion.angles[0], rate))
        parts.append(np.column_stack([np.interp(fine, time, angle) for angle in motion.angles.T]))
    return np.concatenate(parts)


def _transition(start: np.ndarray, end: np.ndarray, rate: float) -> np.ndarray:
    """Return the minimum-jerk transition from one posture to another, followed by rest, shape (n, 4) [rad].

    It is not faster than `MAX_TRANSITION_SPEED_RAD_S`.
    """
    duration = max(PAUSE_S, 1.875 * float(np.abs(end - start).max()) / MAX_TRANSITION_SPEED_RAD_S)
    s = (np.arange(round(duration * rate)) + 1.0) / round(duration * rate)
    ease = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    path = start + ease[:, None] * (end - start)
    return np.concatenate([path, np.repeat(end[None], round(0.5 * PAUSE_S * rate), axis=0)])


def _smooth(name: str, source: str, rate: float, stretches: list[np.ndarray]) -> HumanMotion:
    """Join stretches into one motion, and smooth it with a zero-phase low-pass filter."""
    from scipy.signal import butter, sosfiltfilt

    parts = [np.repeat(stretches[0][:1], round(REST_S * rate), axis=0)]
    for stretch in stretches:
        parts += [_transition(parts[-1][-1], stretch[0], rate), stretch]
    parts.append(np.repeat(stretches[-1][-1:], round(REST_S * rate), axis=0))
    path = np.concatenate(parts)
    return HumanMotion(
        name, source, rate, sosfiltfilt(butter(3, MOTION_LOWPASS_HZ, fs=rate, output="sos"), path, axis=0)
    )


def generated_motion(seed: int, rate: float, duration: float = 30.0) -> HumanMotion:
    """Return minimum-jerk reaching of all four joints between drawn postures, for machines without the recordings."""
    rng = np.random.default_rng([seed, 4])
    low, high = np.array(GENERATED_REACHES["low"]), np.array(GENERATED_REACHES["high"])
    posture = rng.uniform(low, high)
    parts, longest = [np.repeat(posture[None], round(REST_S * rate), axis=0)], round(duration * rate)
    while True:
        end, movement_time = (
            rng.uniform(low, high),
            rng.uniform(GENERATED_REACHES["shortest"], GENERATED_REACHES["longest"]),
        )
        s = (np.arange(round(movement_time * rate)) + 1.0) / round(movement_time * rate)
        move = posture + (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))[:, None] * (end - posture)
        move = np.concatenate([move, np.repeat(end[None], round(rng.uniform(0.1, 0.5) * rate), axis=0)])
        left = longest - sum(map(len, parts))
        if len(move) > left:
            parts.append(np.repeat(posture[None], max(left, 0), axis=0))
            return HumanMotion(f"generated_{seed}", "generated reaching, minimum jerk", rate, np.concatenate(parts))
        parts.append(move)
        posture = end
