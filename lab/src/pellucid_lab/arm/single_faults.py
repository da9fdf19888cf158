"""Single faults of a sensor, a drive or the clock on a whole arm that somebody wears under a supervised law.

Names and sentences are those of the core's list. Here are the faults that an arm of several joints can have and in
which the wearer has no part. A fault of an encoder or a drive concerns one joint; a fault of the force sensors concerns
both cuffs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pellucid import _core
from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.controllers.tree_laws import TreeLaw

from ..drive_reading import EXACT_READING, DriveReading
from .card_law import CardLaw, Point
from .human_motion import HumanMotion
from .rig import ArmRig
from .wearer import Person
from .worn_trial import WornTrial, run

POWER_OFF_S = 3e-3
"""Time in which a power stage takes its power off [s]."""

LATE_S = 0.02
"""Delay of a drive that answers late [s]."""

CURRENT_OFFSET_NM = 3.0
"""Error of a drive's measurement with an offset [N m]."""

SECOND_ENCODER_NOISE_RAD = 1e-4
"""Standard deviation of the noise of a second encoder [rad]. Chosen by judgement; no measurement is recorded."""

SECOND_ENCODER_QUANTUM_RAD = 2.0 * np.pi / 2.0**14
"""Quantum of a second encoder: one of 14 bits a turn [rad]."""

FORCE_QUANTUM_N = 0.02
"""Quantum of a force sensor [N], and a twentieth of it of its moments [N m]."""

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


_HANDLE_MOMENTS = np.array([[0.0] * 6, [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]])
"""The three moments of the handle's force sensor: 1 in their places, 0 elsewhere, shape (2, 6)."""

_MOMENT_PLACES = np.array([[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]] * 2)
"""The three moments of each force sensor: 1 in their places, 0 elsewhere, shape (2, 6)."""

SENSOR_FAULTS: Mapping[str, Callable[[LawInput, LawInput, int], LawInput]] = {
    "encoder_frozen": _encoder_fault(lambda now, then: then),
    "encoder_nan": _encoder_fault(lambda now, then: np.nan),
    "encoder_jump": _encoder_fault(lambda now, then: now + 1.0),
    "encoder_slip": _encoder_fault(lambda now, then: now + 0.1),
    "encoder_flipped": _encoder_fault(lambda now, then: 2.0 * then - now),
    "encoder_half": _encoder_fault(lambda now, then: 0.5 * (then + now)),
    "force_flipped": _force_fault(lambda now, then: -now),
    "force_offset": _force_fault(lambda now, then: now + FORCE_OFFSET_NM * _MOMENT_PLACES),
    "force_triple": _force_fault(lambda now, then: 3.0 * now),
    "force_frozen": _force_fault(lambda now, then: then),
    "force_lost": _force_fault(lambda now, then: np.full_like(now, np.nan)),
    "force_rail": _force_fault(lambda now, then: np.where(_MOMENT_PLACES > 0.0, FORCE_RAIL_NM, now)),
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
    "drive_late": lambda asked, then: (asked, asked),
    "current_zero": lambda asked, then: (asked, 0.0),
    "current_offset": lambda asked, then: (asked, asked + CURRENT_OFFSET_NM),
}
"""Effort that a faulty drive gives and effort that it reports, from the effort asked for now and at the onset. One that
is late is asked for what was asked of it `LATE_S` ago."""

KINDS: Mapping[str, Mapping[str, str]] = {
    kind["name"]: kind for kind in _core.single_faults() if kind["name"] in {**SENSOR_FAULTS, **DRIVE_FAULTS}
}
"""Entry of the core's list of single faults, by name and in the core's order."""


LATE_FAULTS = frozenset({"drive_late"})
"""Faults of a drive that gives what was asked of it `LATE_S` ago."""


@dataclass(frozen=True)
class ForceReading:
    """Errors of the force sensors of cuff and handle; the default has none."""

    gain: tuple[float, float] = (1.0, 1.0)  # reading per force [1]
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)  # offset of the cuff's reading at each joint that carries it [N m]
    moment_offset: float = 0.0  # offset of each moment that the handle reads [N m]
    lag: float = 0.0  # time constant of the first-order lag [s]
    quantum: float = 0.0  # rounding step of forces [N]; a twentieth of it for moments [N m]; 0 for no rounding


EXACT_FORCE = ForceReading()
"""The reading of force sensors without error."""


class FaultyLaw(CardLaw):
    """A card's controller under its supervisor, with one fault from its onset on.

    Parameters
    ----------
    law : TreeLaw
    points : tuple of Point, optional
        Positions of the force sensors, if the controller uses them.
    fault : str
        Name of a fault of `KINDS`; "" for none.
    joint : int
        Index of the joint with the fault.
    onset : float
        Time at which the fault begins [s].
    readings : sequence of DriveReading
        Errors with which each motor's drive measures its own effort; none by default.
    force : ForceReading
        Errors of the force sensors; none by default. A controller with a sensor on a link receives the
        handle's reading unchanged, and the cuff's as joint torques.
    lying : tuple of int
        Indices of the force sensors with a fault: 0 the cuff's, 1 the handle's.
    """

    running: _core.SupervisedTreeLaw

    def __init__(
        self,
        law: TreeLaw,
        points: tuple[Point, Point] | None = None,
        fault: str = "",
        joint: int = 0,
        onset: float = ONSET_S,
        readings: Sequence[DriveReading] = (),
        force: ForceReading = EXACT_FORCE,
        lying: tuple[int, ...] = (0, 1),
    ):
        self.fault, self.joint, self.onset = fault, joint, onset
        self.force, self.lying = force, lying
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
        self.second, self.lagged = None, None
        self.waiting: deque[np.ndarray] = deque(maxlen=round(LATE_S / period) + 1)
        self.encoder = np.random.default_rng([self.joint, 11])

    def hear(self, joints: np.ndarray) -> None:
        """Read the second encoders, where the law's instruments name them; the angles are of the joints [rad]."""
        if not any(one.joint_encoder for one in self.law.instruments):
            return
        noisy = joints + SECOND_ENCODER_NOISE_RAD * self.encoder.standard_normal(len(joints))
        self.second = np.round(noisy / SECOND_ENCODER_QUANTUM_RAD) * SECOND_ENCODER_QUANTUM_RAD

    def measured_wrench(self, wrench: np.ndarray) -> np.ndarray:
        """Return what both force sensors read, shape (2, 6) [N, N m]."""
        said = np.array(self.force.gain)[:, None] * wrench + self.force.moment_offset * _HANDLE_MOMENTS
        if self.force.lag > 0.0 and self.lagged is not None:
            period = self.law.shares[0]["period"]
            said = self.lagged + period / (period + self.force.lag) * (said - self.lagged)
        self.lagged = said
        if self.force.quantum > 0.0:
            quanta = self.force.quantum * np.repeat([1.0, 0.05], 3)
            said = np.round(said / quanta) * quanta
        return said

    def step(self, time: float, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Return the torque that each drive gives, shape (4,) [N m]."""
        if not self.started:
            # In the first reading the motor is off by the stretch of its cable; the law begins with the second.
            self.started = True
            return self.measured
        read, begun = LawInput(time, position, self.measured_wrench(wrench)), time >= self.onset
        if begun and self.then is None:
            self.then = read
        if begun and self.fault in SENSOR_FAULTS:
            told = SENSOR_FAULTS[self.fault](read, self.then, self.joint)
            lies = np.isin([0, 1], self.lying)[:, None]
            read = told._replace(wrench=np.where(lies, told.wrench, read.wrench))
        felt, handle = self.forces(read)
        asked = self.ask(read, felt, handle)
        if self.said == NO_FAULT and self.running.fault != NO_FAULT:
            self.found, self.said = time, self.running.fault
        given, said = asked.copy(), asked.copy()
        if begun and self.asked is None:
            self.asked = asked
        self.waiting.append(asked)
        # A drive without power gives no effort, whatever its fault.
        if begun and self.fault in DRIVE_FAULTS and self.running.enable[self.joint]:
            wanted = self.waiting[0] if self.fault in LATE_FAULTS else asked
            given[self.joint], said[self.joint] = DRIVE_FAULTS[self.fault](wanted[self.joint], self.asked[self.joint])
        self.measured = self.read(said)
        return given

    def ask(self, read: LawInput, felt: np.ndarray | None, handle: np.ndarray | None) -> np.ndarray:
        """Return the torque that the supervised law asks of each drive, (4,) [N m], with what it is given of forces."""
        return self.running.step(
            read.time, read.position, interaction=felt, wrench=handle, drive=self.measured, joint=self.second
        )

    def forces(self, read: LawInput) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Return what the law is given of force sensors: at joints, shape (4,) [N m], and on the link of the handle."""
        if self.points is None:
            return None, None
        if not self.law.whole["sensor_link"] > 0.0:
            felt = self.felt(read.position, read.wrench)
            felt[: len(self.force.offset)] += self.force.offset
            return felt, None
        # The cuff round the upper arm says nothing about joints beyond it.
        felt = np.full(len(read.position), np.nan)
        own = len(self.force.offset)
        felt[:own] = self.felt(read.position, read.wrench * [[1.0], [0.0]])[:own] + self.force.offset
        return felt, read.wrench[1]

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
    safe_excess: float = 0.0  # the same surplus until the output was safe, or to the end where nothing was found [J]
    lying: tuple[int, ...] = (0, 1)  # force sensors that had a fault of force sensors


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
    sound = FaultyLaw(law, points, onset=onset, readings=readings)
    healthy = run(rig, person, sound, motion, joints=sound.hear)
    for number, fault in enumerate(faults):
        if KINDS[fault]["needs"] == "interaction" and points is None:
            continue
        joint = (first + number) % len(law.card.names)
        faulty = FaultyLaw(law, points, fault, joint, onset, readings)
        yield compare_with_healthy(run(rig, person, faulty, motion, joints=faulty.hear), healthy, faulty)


def compare_with_healthy(trial: WornTrial, healthy: WornTrial, law: FaultyLaw) -> ArmFaultTrial:
    """Return the outcome of a trial with a fault, compared with the same trial without it."""
    begin, n = round(law.onset * trial.rate), min(len(trial.limb), len(healthy.limb))
    ends = n - begin
    if np.isfinite(law.found):
        ends = min(ends, max(round((law.found - law.onset + POWER_OFF_S) * trial.rate) + 1, 1))
    work, healthy_work = (
        np.cumsum(np.maximum(np.sum(one.on_limb * one.limb_velocity, axis=1)[begin:n], 0.0)) / one.rate
        for one in (trial, healthy)
    )
    return ArmFaultTrial(
        law.fault,
        law.joint,
        law.found - law.onset,
        law.said,
        float(np.max(work - healthy_work, initial=0.0)),
        float(np.abs(trial.on_limb[begin:n]).max(initial=0.0)),
        float(np.abs(healthy.on_limb[begin:n]).max(initial=0.0)),
        trial.stopped,
        float(np.max((work - healthy_work)[:ends], initial=0.0)),
        law.lying,
    )
