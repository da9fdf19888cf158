"""Single faults of a sensor, a drive or the clock on a whole arm that somebody wears under a supervised law.

Names and sentences are those of the core's list. Here are the faults that an arm of several joints can have and in
which the wearer has no part. A fault of an encoder or a drive concerns one joint; a fault of the force sensors concerns
both cuffs.
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

ONSET_S = 3.0
"""Time at which a fault begins [s]."""

WATCH_S = 3.0
"""Time after the onset for which a fault is simulated, whether or not it is found [s]."""

STUCK_EFFORT_NM = 5.0
"""Effort of a drive that is stuck [N m]."""

FORCE_RAIL_NM = 30.0
"""Reading of a force sensor at the end of its range [N m]."""

FORCE_OFFSET_NM = 3.0
"""Error of a force sensor with an offset [N m]."""


class LawInput(NamedTuple):
    """The inputs of a law in one period."""

    time: float  # [s]
    position: np.ndarray  # (4,) angles of the encoders [rad]
    wrench: np.ndarray  # (2, 6) force [N] and moment [N m] of the sensors at both cuffs


def _replace_one(values: np.ndarray, k: int, value: float) -> np.ndarray:
    """Return a copy of `values` with another `value` at index `k`."""
    copied = values.copy()
    copied[k] = value
    return copied


def _encoder_fault(value: Callable[[float, float], float]) -> Callable[[LawInput, LawInput, int], LawInput]:
    """Return the fault of one encoder whose reading is `value`, a function of the true angle now and at the onset."""
    return lambda now, then, k: now._replace(
        position=_replace_one(now.position, k, value(now.position[k], then.position[k]))
    )


def _force_fault(
    value: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> Callable[[LawInput, LawInput, int], LawInput]:
    """Return the fault of force sensors that read `value`, a function of the true wrenches now and at the onset."""
    return lambda now, then, k: now._replace(wrench=value(now.wrench, then.wrench))


def _clock_fault(ahead: float) -> Callable[[LawInput, LawInput, int], LawInput]:
    """Return the fault of a clock that is `ahead` [s]."""
    return lambda now, then, k: now._replace(time=now.time + ahead)


_HANDLE_MOMENT = np.array([[0.0] * 6, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]])
"""The three moments of the handle's force sensor: 1 in their places, 0 elsewhere, shape (2, 6)."""

SENSOR_FAULTS: Mapping[str, Callable[[LawInput, LawInput, int], LawInput]] = {
    "encoder_frozen": _encoder_fault(lambda now, then: then),
    "encoder_nan": _encoder_fault(lambda now, then: np.nan),
    "encoder_jump": _encoder_fault(lambda now, then: now + 1.0),
    "encoder_slip": _encoder_fault(lambda now, then: now + 0.1),
    "encoder_flipped": _encoder_fault(lambda now, then: 2.0 * then - now),
    "force_flipped": _force_fault(lambda now, then: -now),
    "force_offset": _force_fault(lambda now, then: now + FORCE_OFFSET_NM * _HANDLE_MOMENT),
    "force_triple": _force_fault(lambda now, then: 3.0 * now),
    "force_frozen": _force_fault(lambda now, then: then),
    "force_lost": _force_fault(lambda now, then: np.full_like(now, np.nan)),
    "force_rail": _force_fault(lambda now, then: np.where(_HANDLE_MOMENT > 0.0, FORCE_RAIL_NM, now)),
    "clock_ahead": _clock_fault(1.0),
    "clock_back": _clock_fault(-1.0),
}
"""Faulty input of the law, from the true input now, the true input at the onset, and the index of the joint."""

DRIVE_FAULTS: Mapping[str, Callable[[float, float], tuple[float, float]]] = {
    "drive_reversed": lambda asked, then: (-asked, -asked),
    "drive_triple": lambda asked, then: (3.0 * asked, 3.0 * asked),
    "drive_triple_unseen": lambda asked, then: (3.0 * asked, asked),
    "drive_stuck": lambda asked, then: (STUCK_EFFORT_NM, STUCK_EFFORT_NM),
    "drive_holds": lambda asked, then: (then, then),
    "drive_dead": lambda asked, then: (0.0, 0.0),
    "current_zero": lambda asked, then: (asked, 0.0),
}
"""Effort that a faulty drive gives and effort that it reports, from the effort asked for now and at the onset."""

KINDS: Mapping[str, Mapping[str, str]] = {
    kind["name"]: kind for kind in _core.single_faults() if kind["name"] in {**SENSOR_FAULTS, **DRIVE_FAULTS}
}
"""Entry of the core's list of single faults, by name and in the core's order."""


class FaultyLaw(CardLaw):
    """A law of a card under its supervisor, with one fault from its onset on.

    Parameters
    ----------
    law : TreeLaw
    points : tuple of Point, optional
        Places of the force sensors, where the law uses them.
    fault : str
        Name of a fault of `KINDS`; "" for none.
    joint : int
        Index of the joint with the fault.
    onset : float
        Time at which the fault begins [s].
    readings : sequence of DriveReading
        Errors with which each motor's drive measures its own effort; none by default.
    """

    def __init__(
        self,
        law: TreeLaw,
        points: tuple[Point, Point] | None = None,
        fault: str = "",
        joint: int = 0,
        onset: float = ONSET_S,
        readings: Sequence[DriveReading] = (),
    ):
        self.fault, self.joint, self.onset = fault, joint, onset
        self.readings = tuple(readings) or (EXACT_READING,) * len(law.card.names)
        super().__init__(law, points)

    def reset(self) -> None:
        """Return to the state before the first step, without the fault."""
        self.running, self.started = self.law.supervised(), False
        self.measured, self.then, self.asked = np.zeros(len(self.law.card.names)), None, None
        self.found, self.said = np.nan, NO_FAULT  # time at which the supervisor acted [s], and the fault that it found
        period = self.law.shares[0]["period"]
        self.meters = [_core.DriveReading(one.numbers, period) for one in self.readings]
        self.noise = np.array([one.draw_noise(k) for k, one in enumerate(self.readings)])  # (m, n)
        self.steps = 0

    def step(self, time: float, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Return the torque that each drive gives, shape (4,) [N m]."""
        if not self.started:
            # In the first reading the motor is off by the stretch of its cable; the law begins with the second.
            self.started = True
            return self.measured
        read, begun = LawInput(time, position, wrench), time >= self.onset
        if begun and self.then is None:
            self.then = read
        if begun and self.fault in SENSOR_FAULTS:
            read = SENSOR_FAULTS[self.fault](read, self.then, self.joint)
        felt = None if self.points is None else self.felt(read.position, read.wrench)
        asked = self.running.step(read.time, read.position, interaction=felt, drive=self.measured)
        if self.said == NO_FAULT and self.running.fault != NO_FAULT:
            self.found, self.said = time, self.running.fault
        given, said = asked.copy(), asked.copy()
        if begun and self.asked is None:
            self.asked = asked
        # A drive without power gives no effort, whatever its fault.
        if begun and self.fault in DRIVE_FAULTS and self.running.enable[self.joint]:
            given[self.joint], said[self.joint] = DRIVE_FAULTS[self.fault](asked[self.joint], self.asked[self.joint])
        self.measured = self.read(said)
        return given

    def read(self, effort: np.ndarray) -> np.ndarray:
        """Return the drives' measurements of the efforts that they report, shape (m,) both [N m or N]."""
        noise = self.noise[:, self.steps % self.noise.shape[1]]
        self.steps += 1
        return np.array([one.step(*now) for one, *now in zip(self.meters, effort, noise, strict=True)])


@dataclass(frozen=True)
class ArmFaultTrial:
    """The outcome of one fault while somebody wore the arm."""

    fault: str
    joint: int
    found: float  # time from the onset until the supervisor acted [s]; NaN for never, negative before the onset
    said: str  # fault that the supervisor found
    excess: float  # largest surplus of positive work on the limb over the same run without the fault [J]
    peak: float  # largest torque at one of the wearer's joints from the onset on [N m]
    healthy_peak: float  # the same torque without the fault [N m]
    lost: bool  # whether the trial was cut short because the arm had left its motion


def fault_trials(
    rig: ArmRig,
    person: Person,
    law: TreeLaw,
    motion: HumanMotion,
    points: tuple[Point, Point] | None = None,
    *,
    faults: tuple[str, ...] = tuple(KINDS),
    first: int = 0,
    onset: float = ONSET_S,
    watched: float = WATCH_S,
    readings: Sequence[DriveReading] = (),
) -> Iterator[ArmFaultTrial]:
    """Simulate every fault that a law can have, on one robot and person.

    Faults take the joints in turn, beginning with the joint of index `first`. `onset` is the time at which a fault
    begins and `watched` the time after it that is simulated [s]. `readings` are the errors of the drives' measurements;
    none by default.
    """
    last = round((onset + watched) * motion.rate)
    motion = replace(motion, position=motion.position[:last])
    healthy = run(rig, person, FaultyLaw(law, points, onset=onset, readings=readings), motion)
    for number, fault in enumerate(faults):
        if KINDS[fault]["needs"] == "interaction" and points is None:
            continue
        joint = (first + number) % len(law.card.names)
        faulty = FaultyLaw(law, points, fault, joint, onset, readings)
        yield _compare_with_healthy(run(rig, person, faulty, motion), healthy, faulty)


def _compare_with_healthy(trial: WornTrial, healthy: WornTrial, law: FaultyLaw) -> ArmFaultTrial:
    """Return the outcome of a trial with a fault, compared with the same trial without it."""
    begin, n = round(law.onset * trial.rate), min(len(trial.limb), len(healthy.limb))
    work, healthy_work = (
        np.cumsum(np.maximum(np.sum(one.on_limb * one.limb_velocity, axis=1)[begin:n], 0.0)) / one.rate
        for one in (trial, healthy)
    )
    return ArmFaultTrial(
        law.fault,
        law.joint,
        law.found - law.onset,
        law.said,
        max(float(np.max(work - healthy_work)), 0.0),
        float(np.abs(trial.on_limb[begin:n]).max()),
        float(np.abs(healthy.on_limb[begin:n]).max()),
        trial.stopped,
    )
