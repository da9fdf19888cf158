"""Single faults on a whole arm that somebody wears: what a sensor, a drive or the clock does to a supervised law.

Names and sentences are those of the core's list, of which the ones stand here that an arm of several joints can have
and that need no wearer's part. Faults of an encoder or a drive are of one joint; force sensors are those of both cuffs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ... import _core
from ...control.supervisor_faults import NO_FAULT
from ...control.tree_laws import TreeLaw
from ..drive_reading import EXACT_READING, DriveReading
from .card_law import CardLaw, Point
from .human_motion import HumanMotion
from .rig import ArmRig
from .wearer import Person
from .worn_trial import WornTrial, run

ONSET, WATCHED = 3.0, 3.0
"""When a fault begins, and how long it is watched, found or not [s]."""

STUCK, RAIL, OFFSET = 5.0, 30.0, 3.0
"""Effort of a drive that is stuck, a force sensor's rail, and what it reads too much [N m]."""


class Read(NamedTuple):
    """What a law reads in a period."""

    time: float
    position: np.ndarray  # (4,)
    wrench: np.ndarray  # (2, 6)


def _put(values: np.ndarray, k: int, value: float) -> np.ndarray:
    made = values.copy()
    made[k] = value
    return made


def _encoder(value: Callable[[float, float], float]) -> Callable[[Read, Read, int], Read]:
    """Of what it ought to read now, and read at the onset."""
    return lambda now, then, k: now._replace(position=_put(now.position, k, value(now.position[k], then.position[k])))


def _force(value: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Callable[[Read, Read, int], Read]:
    return lambda now, then, k: now._replace(wrench=value(now.wrench, then.wrench))


def _clock(ahead: float) -> Callable[[Read, Read, int], Read]:
    return lambda now, then, k: now._replace(time=now.time + ahead)


_MOMENT = np.array([[0.0] * 6, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]])  # Of the handle's sensor

READ: Mapping[str, Callable[[Read, Read, int], Read]] = {
    "encoder_frozen": _encoder(lambda now, then: then),
    "encoder_nan": _encoder(lambda now, then: np.nan),
    "encoder_jump": _encoder(lambda now, then: now + 1.0),
    "encoder_slip": _encoder(lambda now, then: now + 0.1),
    "encoder_flipped": _encoder(lambda now, then: 2.0 * then - now),
    "force_flipped": _force(lambda now, then: -now),
    "force_offset": _force(lambda now, then: now + OFFSET * _MOMENT),
    "force_triple": _force(lambda now, then: 3.0 * now),
    "force_frozen": _force(lambda now, then: then),
    "force_lost": _force(lambda now, then: np.full_like(now, np.nan)),
    "force_rail": _force(lambda now, then: np.where(_MOMENT > 0.0, RAIL, now)),
    "clock_ahead": _clock(1.0),
    "clock_back": _clock(-1.0),
}
"""What is read, of what ought to be now and was at the onset, and of a joint."""

GIVEN: Mapping[str, Callable[[float, float], tuple[float, float]]] = {
    "drive_reversed": lambda asked, then: (-asked, -asked),
    "drive_triple": lambda asked, then: (3.0 * asked, 3.0 * asked),
    "drive_triple_unseen": lambda asked, then: (3.0 * asked, asked),
    "drive_stuck": lambda asked, then: (STUCK, STUCK),
    "drive_holds": lambda asked, then: (then, then),
    "drive_dead": lambda asked, then: (0.0, 0.0),
    "current_zero": lambda asked, then: (asked, 0.0),
}
"""What a drive gives and says it gives, of what is asked now and was at the onset."""

KINDS: Mapping[str, Mapping[str, str]] = {
    kind["name"]: kind for kind in _core.single_faults() if kind["name"] in {**READ, **GIVEN}
}
"""What the core says of each, by name in its order."""


class FaultyLaw(CardLaw):
    """A law of a card under its supervisor, with one `fault` of a joint from `onset` [s] on; "": none.

    `readings` say how each motor's drive measures its own effort, by default exactly."""

    def __init__(
        self,
        law: TreeLaw,
        points: tuple[Point, Point] | None = None,
        fault: str = "",
        joint: int = 0,
        onset: float = ONSET,
        readings: Sequence[DriveReading] = (),
    ):
        self.fault, self.joint, self.onset = fault, joint, onset
        self.readings = tuple(readings) or (EXACT_READING,) * len(law.card.names)
        super().__init__(law, points)

    def reset(self) -> None:
        """One more of it, at rest, whole."""
        self.running, self.started = self.law.supervised(), False
        self.measured, self.then, self.asked = np.zeros(len(self.law.card.names)), None, None
        self.found, self.said = np.nan, NO_FAULT  # When the supervisor acted [s], and on what
        period = self.law.shares[0]["period"]
        self.meters = [_core.DriveReading(one.numbers, period) for one in self.readings]
        self.noise = np.array([one.draw_noise(k) for k, one in enumerate(self.readings)])  # (m, n)
        self.steps = 0

    def step(self, time: float, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Torque that each drive gives, shape (4,) [N m]."""
        if not self.started:
            # A trial's first reading is where the motion begins; the motor is a cable's stretch away.
            self.started = True
            return self.measured
        read, begun = Read(time, position, wrench), time >= self.onset
        if begun and self.then is None:
            self.then = read
        if begun and self.fault in READ:
            read = READ[self.fault](read, self.then, self.joint)
        felt = None if self.points is None else self.felt(read.position, read.wrench)
        asked = self.running.step(read.time, read.position, interaction=felt, drive=self.measured)
        if self.said == NO_FAULT and self.running.fault != NO_FAULT:
            self.found, self.said = time, self.running.fault
        given, said = asked.copy(), asked.copy()
        if begun and self.asked is None:
            self.asked = asked
        # What has no power gives nothing, whatever is wrong with it.
        if begun and self.fault in GIVEN and self.running.enable[self.joint]:
            given[self.joint], said[self.joint] = GIVEN[self.fault](asked[self.joint], self.asked[self.joint])
        self.measured = self.read(said)
        return given

    def read(self, effort: np.ndarray) -> np.ndarray:
        """What the drives' measurements make of what they say that they give, shape (m,) both [N m or N]."""
        noise = self.noise[:, self.steps % self.noise.shape[1]]
        self.steps += 1
        return np.array([one.step(*now) for one, *now in zip(self.meters, effort, noise, strict=True)])


@dataclass(frozen=True)
class ArmFaultTrial:
    """What one fault came to while somebody wore the arm."""

    fault: str
    joint: int
    found: float  # From the onset until the supervisor acted [s]; NaN for never, below 0 before there was a fault
    said: str  # What it found
    excess: float  # Positive work on the limb over that of the same run without the fault, at most [J]
    peak: float  # Largest torque at one of the wearer's joints from the onset on [N m]
    healthy_peak: float  # The same without the fault
    lost: bool  # Whether arm and motion went apart, so that the trial was cut short


def fault_trials(
    rig: ArmRig,
    person: Person,
    law: TreeLaw,
    motion: HumanMotion,
    points: tuple[Point, Point] | None = None,
    *,
    faults: tuple[str, ...] = tuple(KINDS),
    first: int = 0,
    onset: float = ONSET,
    watched: float = WATCHED,
    readings: Sequence[DriveReading] = (),
) -> Iterator[ArmFaultTrial]:
    """Every fault that a law can have, of one joint after another from the `first` on, on one robot and person.
    `onset`, `watched` [s]; `readings` of the motors' drives, by default exact."""
    last = round((onset + watched) * motion.rate)
    motion = replace(motion, position=motion.position[:last])
    healthy = run(rig, person, FaultyLaw(law, points, onset=onset, readings=readings), motion)
    for number, fault in enumerate(faults):
        if KINDS[fault]["needs"] == "interaction" and points is None:
            continue
        joint = (first + number) % len(law.card.names)
        faulty = FaultyLaw(law, points, fault, joint, onset, readings)
        yield _trial(run(rig, person, faulty, motion), healthy, faulty)


def _trial(trial: WornTrial, healthy: WornTrial, law: FaultyLaw) -> ArmFaultTrial:
    begin, n = round(law.onset * trial.rate), min(len(trial.limb), len(healthy.limb))
    work, same = (
        np.cumsum(np.maximum(np.sum(one.on_limb * one.limb_velocity, axis=1)[begin:n], 0.0)) / one.rate
        for one in (trial, healthy)
    )
    return ArmFaultTrial(
        law.fault,
        law.joint,
        law.found - law.onset,
        law.said,
        max(float(np.max(work - same)), 0.0),
        float(np.abs(trial.on_limb[begin:n]).max()),
        float(np.abs(healthy.on_limb[begin:n]).max()),
        trial.stopped,
    )
