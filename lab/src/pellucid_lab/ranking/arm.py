"""Simulate every controller of an arm of four joints with a simulated person who reaches: torque, energy, faults."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pellucid.controllers.instruments import Instruments
from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.controllers.tree_laws import TreeLaw, carried, with_force_sensor

from ..arm.card_law import Point, card_of, identified, sensor_points
from ..arm.human_motion import HumanMotion, generated_motion
from ..arm.rig import ArmRig, able_arm, drawn_arms
from ..arm.single_faults import KINDS, FaultyLaw, LawInput, compare_with_healthy
from ..arm.wearer import Person, drawn_people
from ..arm.worn_trial import ArmLaw, WornTrial, run
from ..papers.able.arm_worn import LAWS, LAWS_WITH_FORCE_SENSOR
from ..processes import job_part, tell_job_share
from ..safety.fault_table import FAULT_KINDS
from .foreign_law import ForeignLaw, ForeignProcess
from .strategies import REACHING_TASK, strategies_of_task
from .tried import ControllerTrial, given_and_taken_power

ARMS_SEED = 20261200
"""Seed of the arms and people for the ranking, added to the user's seed. No constant was chosen on them."""

MOTION_S = 12.0
"""Duration of the reaching in which controllers are compared [s]."""

FAULT_ONSET_S = 2.0
"""Time at which a single fault begins [s]."""

FAULT_WATCH_S = 3.0
"""Longest time after its onset for which a fault that nothing finds is simulated [s]."""

FAULT_AFTER_S = 0.05
"""Time after a fault was found for which the simulation goes on [s]."""

UNPOWERED_ARM = "unpowered"
"""Name of the arm without power."""

HIDDEN_FAULTS = frozenset(kind.name for kind in FAULT_KINDS if kind.hidden and kind.group == "drive")
"""Faults that no sensor of the arm can show. It has two encoders at each joint, so that those of an encoder show."""


class UnpoweredArm:
    """An arm whose motors give nothing."""

    def reset(self) -> None:
        """Do nothing, since there is nothing to forget."""

    def step(self, time: float, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Return efforts of 0, shape (4,) [N m]."""
        return np.zeros(len(position))


class CommandedArm(FaultyLaw):
    """A foreign law on the arm, behind the supervisor that every law of several joints has.

    Parameters
    ----------
    law : TreeLaw
        What the supervisor knows of the robot; none of its efforts are used.
    process : ForeignProcess
        The foreign law at work. It is asked with encoders and what both force sensors read, taken to the joints.
    points : tuple of Point
        Places of the force sensors.
    fault, joint, onset
        As `FaultyLaw` takes them.
    """

    def __init__(
        self, law: TreeLaw, process: ForeignProcess, points: tuple[Point, Point], fault: str = "", joint: int = 0,
        onset: float = FAULT_ONSET_S,
    ) -> None:  # fmt: skip
        self.process = process
        super().__init__(law, points, fault, joint, onset)

    def reset(self) -> None:
        """Return to the state before the first step, the foreign law too."""
        super().reset()
        self.running = self.law.supervised(commanded=True)
        self.process.reset()

    def ask(self, read: LawInput, felt: np.ndarray | None, handle: np.ndarray | None) -> np.ndarray:
        """Return the torque that goes to each drive, (4,) [N m], where the foreign law asks for one."""
        heard = np.zeros(len(read.position)) if felt is None else felt
        # The supervisor stops a law without an encoder; nobody has to answer to it.
        command = (
            self.process.efforts("arm", read.time, read.position.tolist(), heard.tolist())
            if np.isfinite(read.position).all()
            else np.zeros(len(read.position))
        )
        return self.running.step(
            read.time, read.position, interaction=felt, drive=self.measured, joint=self.second, command=command
        )


@dataclass(frozen=True)
class ArmInUse:
    """An identified arm on a person who reaches, and the motion that the person makes."""

    rig: ArmRig
    person: Person
    motion: HumanMotion
    laws: dict[str, TreeLaw]  # own laws, by name
    supervision: TreeLaw  # what the supervisor of a foreign law knows of the robot

    @property
    def points(self) -> tuple[Point, Point]:
        """Places of the force sensors."""
        return sensor_points(self.person)

    def faulty(self, name: str, fault: str = "", joint: int = 0) -> FaultyLaw:
        """Return an own law under its supervisor, with one fault from its onset on."""
        points = self.points if name in LAWS_WITH_FORCE_SENSOR else None
        return FaultyLaw(self.laws[name], points, fault, joint, FAULT_ONSET_S)

    def commanded(self, process: ForeignProcess, fault: str = "", joint: int = 0) -> CommandedArm:
        """Return a foreign law under its supervisor, with one fault from its onset on."""
        return CommandedArm(self.supervision, process, self.points, fault, joint)

    def wear(self, law: ArmLaw, until: Callable[[float], bool] | None = None) -> WornTrial:
        """Let the person reach under a law, until a condition on the time [s] holds or to the end."""
        hear = law.hear if isinstance(law, FaultyLaw) else None
        return run(self.rig, self.person, law, self.motion, until=until, joints=hear)


def draw_arm_in_use(index: int, seed: int, only: Sequence[str] | None = None) -> ArmInUse:
    """Draw arm and person `index` of a seed, identify the arm, and build the own laws that `only` names, or all."""
    rig = drawn_arms(able_arm(), index + 1, ARMS_SEED + seed)[index]
    person = drawn_people(index + 1, ARMS_SEED + seed)[index]
    card, noise = card_of(rig, identified(rig)), rig.constants.encoder.noise
    instruments = tuple(
        Instruments(float(quantum) + 4.0 * noise, joint_encoder=True, drive=True, drive_limit=float(most))
        for quantum, most in zip(rig.quanta, rig.limits, strict=True)
    )
    names = [name for name in LAWS if only is None or name in only]
    laws = {name: LAWS[name](card, instruments=instruments) for name in names}
    motion = generated_motion(1000 * seed + index, rig.constants.sampling.rate, MOTION_S)
    return ArmInUse(rig, person, motion, laws, with_force_sensor(carried(card, instruments=instruments)))


def arm_pair(
    index: int, seed: int, only: Sequence[str] | None = None, laws: Sequence[ForeignLaw] = ()
) -> list[ControllerTrial]:
    """Identify arm `index`, and let person `index` wear each of its laws and foreign `laws`.

    `only` names the own laws that are tried; all by default. Every law is behind the supervisor of several joints, with
    two encoders and a measured drive at each joint.
    """
    wanted = tuple(strategies_of_task(REACHING_TASK)) if only is None else only
    parts, made = 1 + len(wanted) + len(laws), []
    with job_part(0, parts):
        in_use = draw_arm_in_use(index, seed, wanted)
    for part, name in enumerate(wanted, 1):
        with job_part(part, parts):
            if name == UNPOWERED_ARM:
                made.append(_trial(name, index, in_use.wear(UnpoweredArm())))
                continue
            law = in_use.faulty(name)
            tried = _trial(name, index, in_use.wear(law), law.said)
            made.append(replace(tried, fault_energy=_worst_fault(in_use, lambda *f, n=name: in_use.faulty(n, *f))))
    for part, foreign in enumerate(laws, 1 + len(wanted)):
        with job_part(part, parts), closing(ForeignProcess(foreign)) as process:
            if process.fault == NO_FAULT and "arm" not in process.robots:
                continue
            law = in_use.commanded(process)
            worn = in_use.wear(law)
            fault = process.fault if process.fault != NO_FAULT else law.said
            tried = _trial(foreign.name, index, worn, fault)
            if fault == NO_FAULT:
                tried = replace(tried, fault_energy=_worst_fault(in_use, lambda *f, p=process: in_use.commanded(p, *f)))
            made.append(tried)
    return made


def _trial(name: str, index: int, trial: WornTrial, fault: str = NO_FAULT) -> ControllerTrial:
    """Return what a trial says of a law; one that was stopped has no torque."""
    power = np.sum(trial.on_limb * trial.limb_velocity, axis=1)[trial.counted]
    off = float(np.sqrt(np.mean(trial.error**2)))
    return ControllerTrial(
        REACHING_TASK, name, index, trial.interaction_rms if fault == NO_FAULT else float("nan"),
        *given_and_taken_power(power, trial.rate), deviation=off, fault=fault,
    )  # fmt: skip


def _is_over(law: FaultyLaw, time: float) -> bool:
    """Return whether a trial with a fault may end at a `time` [s]."""
    return time >= min(FAULT_ONSET_S + FAULT_WATCH_S, law.found + FAULT_AFTER_S)


def _worst_fault(in_use: ArmInUse, make: Callable[[str, int], FaultyLaw]) -> float | None:
    """Return the most energy that a single fault gives the person until the robot is safe [J].

    Faults take the joints in turn. None if the supervisor stopped the law before any fault began.
    """
    until = FAULT_ONSET_S + FAULT_WATCH_S
    law = make("", 0)
    healthy, worst = in_use.wear(law, lambda time: time >= until), 0.0
    if law.found < FAULT_ONSET_S:
        return None
    for number, (fault, kind) in enumerate(KINDS.items()):
        tell_job_share((number + 1.0) / (len(KINDS) + 1.0))
        if fault in HIDDEN_FAULTS or (kind["needs"] == "interaction" and law.points is None):
            continue
        faulty = make(fault, number % len(law.law.card.names))
        trial = in_use.wear(faulty, partial(_is_over, faulty))
        worst = max(worst, compare_with_healthy(trial, healthy, faulty).safe_excess)
    return worst
