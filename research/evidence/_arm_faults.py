"""Single faults and healthy use of worn arms under a supervised law of several joints.

Arms and wearers are sampled as those of `lab/arm`: cables, load friction, misaligned axes, cuffs on soft tissue. The
law knows none of these effects. Each arm is identified from its own recordings. Instruments have realistic errors.
Drives and force sensors have a gain error of 5 %, an offset of 1 % of the effort limit, a lag of 0.3 to 2 ms, noise and
a quantum. Each joint has a second encoder. Thresholds were chosen on arms of `TUNING_SEEDS`; `SEED` serves only this
test.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from pellucid.controllers.instruments import Instruments
from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.controllers.tree_laws import TreeLaw, carried, with_force_sensor
from pellucid.models.tree_card import TreeCard
from pellucid.study.results import ResultRow
from pellucid_lab.arm.card_law import SENSOR_LINKS, Point, card_of, identified, sensor_points
from pellucid_lab.arm.human_motion import JOINTS, HumanMotion, generated_motion
from pellucid_lab.arm.rig import ArmRig, able_arm, drawn_arms
from pellucid_lab.arm.single_faults import (
    FORCE_QUANTUM_N,
    KINDS,
    ArmFaultTrial,
    FaultyLaw,
    ForceReading,
    compare_with_healthy,
)
from pellucid_lab.arm.wearer import Person, drawn_people
from pellucid_lab.arm.worn_trial import WornTrial, run
from pellucid_lab.drive_reading import LAGS_S, DriveReading, stated_readings
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

from ._supervisor_page import FaultFigure, fault_figure

SEED = 20290201
"""Seed of the arms, wearers and instruments of the proof: nothing was chosen on them."""

TUNING_SEEDS = (20261101, 20261102, 20261103, 20281101, 20281103, 20281105)
"""Seeds of the arms on which thresholds were chosen."""

ARMS = sized(5, smallest=1)
"""Number of drawn arms, each with a wearer of its own."""

JOINT_COUNT = sized(4, smallest=1)
"""Number of joints that have each fault of an encoder or a drive."""

ONSET_S = 2.0
"""Time at which a fault begins [s]."""

WATCH_S = sized(10.0, smallest=1.0)
"""Longest time after the onset for which a fault that nothing finds is simulated [s]."""

AFTER_S = 0.05
"""Time after a fault was found for which the trial goes on [s]."""

LIFE_S = sized(60.0, smallest=3.0)
"""Duration of a healthy life of each arm under each law [s]."""

LONG_HEALTHY_HOURS = sized(3.0, smallest=0.001)
"""Healthy use of all arms together in which the watch of each drive's lateness may not stop anybody [h]."""

LONG_LIFE_S = sized(120.0, smallest=3.0)
"""Duration of each of those lives, each with a motion of its own [s]."""

DRIVE_ALARM = "drive_effort"
"""Fault that the watches of a drive name, that of its lateness among them: no drive of a healthy life has one."""

FORCE_GAIN_ERROR = 0.05
"""Relative error of a force sensor's gain [1]."""

FORCE_OFFSET_SHARE = 0.01
"""Offset of force sensors at a joint, as a share of its limit of effort [1]."""

FORCE_FAULTS = ("force_flipped", "force_offset", "force_triple", "force_frozen", "force_lost", "force_rail")
"""Faults of force sensors, by the core's names."""

ENCODER_FAULTS = ("encoder_frozen", "encoder_jump", "encoder_flipped", "encoder_half")
"""Faults of an encoder, by the core's names."""

DRIVE_FAULTS = ("drive_reversed", "drive_triple", "drive_stuck", "drive_dead", "drive_late", "current_zero",
                "current_offset")  # fmt: skip
"""Faults of a drive or of its measurement, by the core's names."""

LYING = ((0,), (1,), (0, 1))
"""Force sensors with a fault: that of the upper arm's cuff, that of the handle, both."""

OWN_LIMITS = ("velocity", "range")
"""Faults of limits that a wearer exceeds by moving faster or farther than the card allows. They are not false alarms
and are counted separately."""

FORCE_LAW = "force_sensors"
"""Name of the law that reads force sensors."""


@dataclass(frozen=True)
class DrawnWear:
    """A drawn arm with its identified card, its wearer and the errors of its instruments."""

    rig: ArmRig
    person: Person
    card: TreeCard
    readings: tuple[DriveReading, ...]  # of each drive
    force: ForceReading
    points: tuple[Point, Point]

    def instruments(self, *, second_encoder: bool = True) -> tuple[Instruments, ...]:
        """Return what the robot measures at each joint."""
        noise = self.rig.constants.encoder.noise
        return tuple(
            Instruments(float(quantum) + 4.0 * noise, joint_encoder=second_encoder, drive=True, drive_limit=float(most))
            for quantum, most in zip(self.rig.quanta, self.rig.limits, strict=True)
        )

    def law(self, name: str, *, second_encoder: bool = True) -> TreeLaw:
        """Return a law by name: `carried`, or `force_sensors` of cuff and handle."""
        measured = self.instruments(second_encoder=second_encoder)
        law = carried(self.card, instruments=measured)
        if name == "carried":
            return law
        handle = self.card.bodies[SENSOR_LINKS[1]]
        return with_force_sensor(law, body=handle, point=self.points[1], at_joints=JOINTS[: SENSOR_LINKS[0] + 1])

    def faulty(self, law: TreeLaw, fault: str = "", joint: int = 0, lying: tuple[int, ...] = (0, 1)) -> FaultyLaw:
        """Return a law with one fault from its onset on, behind the arm's instruments."""
        points = self.points if law.whole["sensor_link"] > 0.0 else None
        return FaultyLaw(law, points, fault, joint, ONSET_S, self.readings, self.force, lying)

    def live(self, law: FaultyLaw, motion: HumanMotion) -> WornTrial:
        """Wear the arm under a law until a while after it found something, or to the end of the motion."""
        return run(self.rig, self.person, law, motion, joints=law.hear, until=lambda time: time >= law.found + AFTER_S)


@cache
def draw_wear(seed: int, count: int) -> tuple[DrawnWear, ...]:
    """Draw arms, wearers and instruments, and identify each arm."""
    rng, rig = np.random.default_rng([seed, 71]), able_arm()
    made = []
    for arm, person in zip(drawn_arms(rig, count, seed), drawn_people(count, seed), strict=True):
        card = card_of(arm, identified(arm))
        readings = tuple(stated_readings(float(most))[rng.integers(8)] for most in arm.limits)
        signs = rng.choice([-1.0, 1.0], 6)
        force = ForceReading(
            gain=tuple(1.0 + FORCE_GAIN_ERROR * signs[:2]),
            offset=tuple(FORCE_OFFSET_SHARE * arm.limits[: SENSOR_LINKS[0] + 1] * signs[2:5]),
            moment_offset=float(FORCE_OFFSET_SHARE * arm.limits[-1] * signs[5]),
            lag=float(rng.uniform(*LAGS_S)),
            quantum=FORCE_QUANTUM_N,
        )
        made.append(DrawnWear(arm, person, card, readings, force, sensor_points(person)))
    return tuple(made)


@dataclass(frozen=True)
class ArmOutcome:
    """What became of one arm."""

    trials: tuple[ArmFaultTrial, ...]  # faults, with second encoders
    one_encoder: tuple[ArmFaultTrial, ...]  # faults of encoders, without second ones
    alarms: tuple[str, ...]  # what healthy lives were stopped for
    healthy: float  # time of healthy lives [s]


def outcome(wear: DrawnWear, seed: int) -> ArmOutcome:
    """Return what became of one arm under every fault, and of its healthy lives."""
    rate = wear.rig.constants.sampling.rate
    motion = generated_motion(seed, rate, ONSET_S + WATCH_S)
    laws = {name: wear.law(name) for name in (FORCE_LAW, "carried")}
    healthy = {name: wear.live(wear.faulty(law), motion) for name, law in laws.items()}

    def trial(name: str, law: TreeLaw, fault: str, joint: int = 0, lying: tuple[int, ...] = (0, 1)) -> ArmFaultTrial:
        faulty = wear.faulty(law, fault, joint, lying)
        return compare_with_healthy(wear.live(faulty, motion), healthy[name], faulty)

    made = [trial(FORCE_LAW, laws[FORCE_LAW], fault, lying=which) for fault in FORCE_FAULTS for which in LYING]
    alone = []
    for number, fault in enumerate((*ENCODER_FAULTS, *DRIVE_FAULTS)):
        for joint in range(JOINT_COUNT):
            name = tuple(laws)[(number + joint) % len(laws)]
            made.append(trial(name, laws[name], fault, joint))
            if fault in ENCODER_FAULTS and joint % 2 == 0:
                alone.append(trial(name, wear.law(name, second_encoder=False), fault, joint))
    alarms, lived = [], 0.0
    for number, law in enumerate(laws.values()):
        life = wear.faulty(law)
        lived += wear.live(life, generated_motion(1000 + 10 * seed + number, rate, LIFE_S)).limb.shape[0] / rate
        alarms += [life.said] if np.isfinite(life.found) else []
    return ArmOutcome(tuple(made), tuple(alone), tuple(alarms), lived)


@dataclass(frozen=True)
class LongLife:
    """One healthy life of an arm."""

    arm: int  # index of the drawn arm
    law: str
    said: str  # fault for which it was stopped; "none" for none
    seconds: float  # time until then, or its whole duration [s]


def long_life(wear: DrawnWear, arm: int, number: int, seed: int = SEED) -> LongLife:
    """Return the healthy life of a number on an arm: laws take turns, and every life has a motion of its own."""
    law = (FORCE_LAW, "carried")[number % 2]
    rate = wear.rig.constants.sampling.rate
    motion = generated_motion(seed % 100_000 + 1000 * arm + number, rate, LONG_LIFE_S)
    faulty = wear.faulty(wear.law(law))
    trial = wear.live(faulty, motion)
    return LongLife(arm, law, faulty.said, trial.limb.shape[0] / rate)


def long_lives(seed: int = SEED, arms: int = ARMS, hours: float = LONG_HEALTHY_HOURS) -> list[LongLife]:
    """Return the long healthy lives of drawn arms, so many `hours` in all [h] if none is stopped."""
    count = max(round(3600.0 * hours / LONG_LIFE_S / arms), 2)
    wears = draw_wear(seed, arms)
    return ordered_results(
        [(long_life, wear, arm, number, seed) for number in range(count) for arm, wear in enumerate(wears)]
    )


def long_life_rows(lives: Sequence[LongLife]) -> Iterator[ResultRow]:
    """Yield false alarms of the watches of arms' drives in long healthy lives, and what else ended some."""
    alarms = Counter(life.said for life in lives if life.said not in (*OWN_LIMITS, NO_FAULT))
    ended = Counter(life.said for life in lives if life.said in OWN_LIMITS)
    words = ", ".join(f"{said} {count}" for said, count in alarms.most_common()) or "none"
    limits = ", ".join(f"{said} {count}" for said, count in ended.most_common()) or "none"
    hours = sum(life.seconds for life in lives) / 3600.0
    said = f"of {len(lives)} lives of {len({life.arm for life in lives})} arms under two laws, {hours:.3g} h"
    yield _row("long_lives.drive_alarms", alarms[DRIVE_ALARM], "1", f"{said}; late drives are watched in all of them")
    yield _row("long_lives.false_alarms", alarms.total(), "1",
               f"{said}: {words}; ended at the card's own limits: {limits}")  # fmt: skip
    yield _row("long_lives.healthy_hours", hours, "h", f"lives of {LONG_LIFE_S:g} s, each with a motion of its own")


def outcomes(seed: int = SEED, arms: int = ARMS) -> list[ArmOutcome]:
    """Return what became of each drawn arm."""
    return ordered_results([(outcome, wear, k + 1) for k, wear in enumerate(draw_wear(seed, arms))])


def arm_rows(made: Sequence[ArmOutcome] | None = None) -> Iterator[ResultRow]:
    """Yield shares of faults that were found, excess energies and false alarms."""
    made = outcomes() if made is None else made
    trials = [trial for one in made for trial in one.trials]
    force = [t for t in trials if t.fault in FORCE_FAULTS]
    motion = [t for t in trials if t.fault not in FORCE_FAULTS]
    alone = [t for one in made for t in one.one_encoder]
    said = f"{len(made)} drawn arms and wearers, seed {SEED}; drives, force sensors and second encoders as in the table"
    worst = max(force, key=lambda t: t.safe_excess)
    yield _row(
        "force_sensor.found", _found(force), "%", f"of {len(force)}; gain, sign, offset, frozen, silent, rail; {said}"
    )
    yield _row("force_sensor.worst_excess_energy", worst.safe_excess, "J", f"{worst.fault}; until safe; {said}")
    yield _row("encoder_and_drive.found", _found(motion), "%", f"of {len(motion)}; {said}")
    worst = max(motion, key=lambda t: t.safe_excess)
    yield _row("encoder_and_drive.worst_excess_energy", worst.safe_excess, "J", f"{worst.fault}; until safe; {said}")
    yield _row(
        "encoder.found_with_one_encoder", _found(alone), "%", f"of {len(alone)}, without second encoders; {said}"
    )
    ended = [alarm for one in made for alarm in one.alarms]
    alarms = [alarm for alarm in ended if alarm not in OWN_LIMITS]
    early = sum(t.found < 0.0 for t in trials)
    named = f": {', '.join(sorted(set(alarms)))}" if alarms else ""
    said = f"{len(alarms)} in lives, {early} before a fault began{named}"
    yield _row("false_alarms", len(alarms) + early, "1", f"{said}; "
               f"{len(ended) - len(alarms)} ended beyond the card's velocity or range")  # fmt: skip
    yield _row("healthy_hours", sum(one.healthy for one in made) / 3600.0, "h", f"{2 * len(made)} lives under two laws")


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"safety.arm.{name}", float(value), unit, "evidence", "simulated", None, note)


def _found(trials: Sequence[ArmFaultTrial]) -> float:
    """Return the share of trials whose fault was found, and not before it began [%]."""
    return 100.0 * sum(t.found >= 0.0 for t in trials) / max(len(trials), 1)


def arm_fault_figures(made: Sequence[ArmOutcome]) -> Iterator[FaultFigure]:
    """Yield what became of every fault of arms, with second encoders and without."""
    by_robot = {
        "arm": [trial for one in made for trial in one.trials],
        "arm_one_encoder": [trial for one in made for trial in one.one_encoder],
    }
    for robot, trials in by_robot.items():
        for name in dict.fromkeys(trial.fault for trial in trials):
            own = [trial for trial in trials if trial.fault == name]
            sentence = KINDS[name]["sentence"]
            if robot == "arm":
                sentence = sentence.replace(", the only one,", "")
            yield fault_figure(
                robot, name, sentence, hidden=False,
                found=[trial.found for trial in own], excess=[trial.safe_excess for trial in own],
            )  # fmt: skip
