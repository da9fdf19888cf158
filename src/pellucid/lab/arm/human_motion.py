"""How an arm moves: as people were recorded in a robot of four joints, or by generated reaching where that is not here.

Angles are abduction, flexion, internal rotation and elbow flexion, in this order, positive as named: the shoulder's are
turns one after another from the arm that hangs, about an axis that points forwards, then one to the side, then along
the upper arm. The recorded people wore a robot whose axes follow each other in this order, so its angles are the rig's.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from ...datasets import RecordedMotion, recorded_motions

JOINTS = ("abduction", "flexion", "internal_rotation", "elbow_flexion")
"""In the order of the chain, from the trunk outwards."""

CUT_OFF = 4.0  # Hz: people's joints move below it; the recorded angles are steps of a fraction of a degree
PAUSE = 0.4  # s: rest that recordings were cut free of, put back between two motions
FASTEST = 1.2  # rad/s: at most, of the way between where one motion ends and the next begins
LEADS = 1.0  # s: rest before and after everything

REACHES = {"low": (0.15, 0.1, -0.3, 0.6), "high": (0.9, 1.3, 0.9, 2.0), "shortest": 0.8, "longest": 1.8}
"""Of generated reaching: where it ends [rad], how long a movement takes [s]; inside what people were seen to do."""


@dataclass(frozen=True, eq=False)
class HumanMotion:
    """A motion of all four joints, smooth, at rest at both ends."""

    name: str
    source: str  # Where it comes from, in words
    rate: float  # [Hz]
    position: np.ndarray = field(repr=False)  # (n, 4) [rad]

    @property
    def velocity(self) -> np.ndarray:
        """Shape (n, 4) [rad/s]."""
        return np.gradient(self.position, 1.0 / self.rate, axis=0)

    @property
    def acceleration(self) -> np.ndarray:
        """Shape (n, 4) [rad/s^2]."""
        return np.gradient(self.velocity, 1.0 / self.rate, axis=0)

    @property
    def duration(self) -> float:
        """How long it lasts [s]."""
        return len(self.position) / self.rate


def people() -> tuple[str, ...]:
    """Who was recorded; a DatasetError where the recordings are not on this machine."""
    return tuple(dict.fromkeys(motion.person for motion in recorded_motions(JOINTS)))


def recorded_motion(
    person: str, rate: float, *, repetition: int = 1, tasks: Collection[int] = (1, 2, 3, 4, 5, 6)
) -> HumanMotion:
    """What one person did in one `repetition` of some `tasks`, one after another, smooth at a `rate` [Hz]."""
    own = [m for m in recorded_motions(JOINTS) if m.person == person and m.repetition == repetition and m.task in tasks]
    if not own:
        raise ValueError(f"person {person!r}, repetition {repetition}: no motion; known: {', '.join(people())}")
    stretches = [_joined(list(of_task), rate) for _, of_task in groupby(own, key=lambda motion: motion.task)]
    return _smooth(f"{person}_{repetition}", f"recorded, {person}, repetition {repetition}", rate, stretches)


def _joined(motions: list[RecordedMotion], rate: float) -> np.ndarray:
    """A task's motions at a `rate`, with the rest between them put back, shape (n, 4) [rad]."""
    parts: list[np.ndarray] = []
    for motion in motions:
        time = np.arange(len(motion.angles)) / motion.rate
        fine = np.arange(round(time[-1] * rate)) / rate
        if parts:
            parts.append(_way(parts[-1][-1], motion.angles[0], rate))
        parts.append(np.column_stack([np.interp(fine, time, angle) for angle in motion.angles.T]))
    return np.concatenate(parts)


def _way(start: np.ndarray, end: np.ndarray, rate: float) -> np.ndarray:
    """From one posture to another by minimum jerk, no faster than `FASTEST`, then rest, shape (n, 4) [rad]."""
    duration = max(PAUSE, 1.875 * float(np.abs(end - start).max()) / FASTEST)
    s = (np.arange(round(duration * rate)) + 1.0) / round(duration * rate)
    ease = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    way = start + ease[:, None] * (end - start)
    return np.concatenate([way, np.repeat(end[None], round(0.5 * PAUSE * rate), axis=0)])


def _smooth(name: str, source: str, rate: float, stretches: list[np.ndarray]) -> HumanMotion:
    """Stretches one after another, without lag, without what is faster than people."""
    from scipy.signal import butter, sosfiltfilt

    parts = [np.repeat(stretches[0][:1], round(LEADS * rate), axis=0)]
    for stretch in stretches:
        parts += [_way(parts[-1][-1], stretch[0], rate), stretch]
    parts.append(np.repeat(stretches[-1][-1:], round(LEADS * rate), axis=0))
    path = np.concatenate(parts)
    return HumanMotion(name, source, rate, sosfiltfilt(butter(3, CUT_OFF, fs=rate, output="sos"), path, axis=0))


def generated_motion(seed: int, rate: float, duration: float = 30.0) -> HumanMotion:
    """Reaching between drawn postures by minimum jerk in all four joints, for a machine without the recordings."""
    rng = np.random.default_rng([seed, 4])
    low, high = np.array(REACHES["low"]), np.array(REACHES["high"])
    at = rng.uniform(low, high)
    parts, longest = [np.repeat(at[None], round(LEADS * rate), axis=0)], round(duration * rate)
    while True:
        end, took = rng.uniform(low, high), rng.uniform(REACHES["shortest"], REACHES["longest"])
        s = (np.arange(round(took * rate)) + 1.0) / round(took * rate)
        move = at + (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))[:, None] * (end - at)
        move = np.concatenate([move, np.repeat(end[None], round(rng.uniform(0.1, 0.5) * rate), axis=0)])
        left = longest - sum(map(len, parts))
        if len(move) > left:
            parts.append(np.repeat(at[None], max(left, 0), axis=0))
            return HumanMotion(f"generated_{seed}", "generated reaching, minimum jerk", rate, np.concatenate(parts))
        parts.append(move)
        at = end
