"""Every single fault under every law on simulated robots and wearers: detection, time to detection, and effect.

The effect is measured until the output is safe: excess work on the limb, peak torque of the strap, impulse of the
drive.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pellucid import _core
from pellucid.controllers.supervised import SupervisedLaw

from ..drive_reading import stated_readings
from ..elbow.rig import able_elbow, drawn_rigs
from ..pointing.conditions import identify_cards
from ..pointing.people import draw_people
from ..pointing.rig import elbow_participants
from ..processes import ordered_results
from .worn_robot import LAWS, WornRobot, draw_sudden_stops, make_worn_robot

JUDGED_SEED = 20290115
"""Seed of the test set of robots, on which no threshold was chosen.

Thresholds were chosen on `law_comparison.tuning_robots`, on more robots of their seed, and on robots of the seeds
20281101, 20281103, 20281105 and 20281107."""

MAX_WATCH_S = 10.0
"""Longest time after its onset for which a fault is watched that the supervisor does not find [s].

Chosen by judgement; no measurement is recorded."""

ONSET_RANGE_S = (2.0, 5.0)
"""Earliest and latest onset of a fault that is not there from the start [s].

Chosen by judgement; no measurement is recorded."""

ENERGY_REPORT_PERIODS = 5
"""Number of control periods between two values of energy that the core returns."""

ONSET_STEP_S = 0.05
"""Step to which onsets are rounded [s], so that an onset falls on a value of energy that the core returns."""

APPROACHED_THRESHOLDS = {
    "lasting": "wearer_torque", "push": "wearer_push", "contradiction": "force_tolerance", "burst": "force_burst",
    "excess": "force_excess", "spent": "budget_store", "ringing": "ringing_limit",
    "shaking": "shaking_limit",
    "surplus": "drive_surplus",
    "unexplained": "unexplained_limit",
}  # fmt: skip
"""Name of the supervisor's threshold for each watched quantity whose largest healthy value the core reports."""


@dataclass(frozen=True)
class FaultKind:
    """One single fault of the core's list, `bindings/single_fault.hpp`."""

    name: str
    group: str  # part that fails, such as the encoder or the drive
    sentence: str  # description for the page
    needs: str  # input that a law must use to have this fault: "interaction", "muscle" or "" for none
    at_start: bool  # whether the fault is there from the start
    joint_encoder: bool  # whether the robot has a second encoder, at the joint
    hidden: str  # reason why no sensor of the robot can show the fault; "" where one can

    @property
    def needs_elbow_rig(self) -> bool:
        """Whether only the elbow's rig can play it, which has a table and a strap that opens."""
        return self.name in ("wearer_blocked", "strap_opens")


FAULT_KINDS: tuple[FaultKind, ...] = tuple(FaultKind(**kind) for kind in _core.single_faults())
"""Every single fault, in the core's order."""

DETECTABLE_FAULTS = frozenset(kind.name for kind in FAULT_KINDS if not kind.hidden)
"""Names of the faults that some sensor of a robot can show."""


@dataclass(frozen=True)
class FaultTrial:
    """The outcome of one fault under one law on one robot."""

    kind: str
    law: str
    robot: int
    early: bool  # whether the supervisor acted before the onset of the fault
    found: float  # time from the onset until the supervisor acted [s]; NaN for never
    safe: float  # time from the onset until the output was safe [s]; NaN for never
    fault: str  # fault that the supervisor found
    mode: str  # mode of the supervisor at the end
    excess: float  # largest surplus of positive work on the limb over the same run without the fault, until safe [J]
    peak: float  # largest torque of the strap until safe [N m]
    impulse: float  # impulse of the drive until safe [N m s]
    # Least speed of the elbow's motor in the five periods before the onset, or the knee's speed at the onset [rad/s]
    onset_speed: float


@dataclass(frozen=True)
class HealthyLife:
    """A stretch of healthy use of one law on one robot."""

    law: str
    robot: int
    hours: float  # duration until the end or the first alarm [h]
    alarm: str  # fault that was found although there was none; "none" without a false alarm
    energy: float  # mean positive power on the limb [W]
    nearest: Mapping[str, float]  # largest value of each watched quantity over its threshold, by the threshold's name


@dataclass(frozen=True)
class FaultTable:
    """All trials with a fault, and all stretches of healthy use."""

    trials: tuple[FaultTrial, ...]
    healthy: tuple[HealthyLife, ...]

    def trials_of(self, kind: str) -> tuple[FaultTrial, ...]:
        """Return the trials of the fault of a name."""
        return tuple(trial for trial in self.trials if trial.kind == kind)


def draw_worn_robot(index: int, seed: int = JUDGED_SEED) -> WornRobot:
    """Draw a robot and its wearer; with the default seed it belongs to the test set."""
    robot = drawn_rigs(able_elbow(), index + 1, seed=seed)[index]
    rig = elbow_participants(robot)
    wearer, other = draw_people(rig, np.random.default_rng([seed, index]), count=6)[:2]
    worn = make_worn_robot(rig, wearer, identify_cards(robot), seed + index)
    return worn.commissioned(other)


def try_robot(worn: WornRobot, index: int, hours: float, laws: Sequence[str] = LAWS) -> FaultTable:
    """Try every fault that a robot and its `laws` can have, and `hours` of healthy use, divided among the laws."""
    trials, healthy = [], []
    for name in laws:
        trials += try_law(worn, index, name, worn.law(name))
        seconds = 3600.0 * hours / len(laws)
        stops = draw_sudden_stops(seconds, np.random.default_rng([index, 3]))
        run = worn.live(worn.law(name), longest=seconds, seconds=np.inf, stops=stops)
        energy = run["energy"][-1] if len(run["energy"]) else 0.0
        duration = run["periods"] * worn.rig.period
        nearest = {
            threshold: run[quantity] / worn.law(name).supervision[threshold]
            for quantity, threshold in APPROACHED_THRESHOLDS.items()
        }
        healthy.append(HealthyLife(name, index, duration / 3600.0, run["fault"], float(energy) / duration, nearest))
    return FaultTable(tuple(trials), tuple(healthy))


def try_law(worn: WornRobot, index: int, name: str, law: SupervisedLaw) -> Iterator[FaultTrial]:
    """Try every fault that a robot can have under a supervised law.

    `index` is the robot's number and `name` the law's; both seed the random draws.
    """
    period, uses = worn.rig.period, getattr(law, "uses", law.law.uses)
    law_of_two_encoders = law.changed(joint_expected=1.0)
    longest = ONSET_RANGE_S[1] + MAX_WATCH_S + 1.0
    stops = draw_sudden_stops(longest, np.random.default_rng([index, 5]))
    energy_interval = ENERGY_REPORT_PERIODS * period
    healthy = worn.live(law, longest=longest, seconds=np.inf, stops=stops)["energy"]
    for number, kind in enumerate(FAULT_KINDS):
        if kind.needs and kind.needs not in uses:
            continue
        rng = np.random.default_rng([index, number, sum(map(ord, name))])
        onset = 0.0 if kind.at_start else round(rng.uniform(*ONSET_RANGE_S) / ONSET_STEP_S) * ONSET_STEP_S
        run = worn.live(
            law_of_two_encoders if kind.joint_encoder else law, kind.name, onset=onset, seconds=MAX_WATCH_S,
            longest=longest, stops=stops, seed=int(rng.integers(1, 2**60)),
        )  # fmt: skip
        begin, faulty = round(onset / energy_interval), run["energy"]
        n = min(len(faulty), len(healthy) - begin)
        # Energy of the healthy run since the onset, for comparison.
        without_fault = healthy[begin : begin + n] - (healthy[begin - 1] if n > 0 and begin else 0.0)
        yield FaultTrial(
            kind.name,
            name,
            index,
            run["early"] > 0,
            run["found"] * period if run["found"] >= 0 else float("nan"),
            run["safe"] * period if run["safe"] >= 0 else float("nan"),
            run["fault"],
            run["mode"],
            max(float(np.max(faulty[:n] - without_fault)), 0.0) if n > 0 else 0.0,
            run["peak"],
            run["impulse"],
            run["onset_speed"],
        )


def with_stated_reading(worn: WornRobot, index: int) -> WornRobot:
    """Return the same robot with a drive that measures its effort as badly as its stated accuracy permits.

    The `index` chooses one of the eight `stated_readings`.
    """
    readings = stated_readings(worn.law("compensation").values["effort_limit"])
    return replace(worn, reading=readings[index % len(readings)])


def _one_robot_table(index: int, hours: float, seed: int, inexact: bool) -> FaultTable:
    """Return the table of one simulated robot."""
    worn = draw_worn_robot(index, seed)
    return try_robot(with_stated_reading(worn, index) if inexact else worn, index, hours)


def fault_table(
    robots: int = 20,
    hours: float = 10.0,
    workers: int | None = None,
    seed: int = JUDGED_SEED,
    *,
    inexact: bool = False,
) -> FaultTable:
    """Return the table of `robots` simulated robots, with `hours` of healthy use of all robots and laws together.

    Drives measure their effort exactly; if `inexact`, each has one of `stated_readings`.
    """
    jobs = [(_one_robot_table, index, hours / robots, seed, inexact) for index in range(robots)]
    return join_tables(ordered_results(jobs, workers))


def join_tables(tables: Sequence[FaultTable]) -> FaultTable:
    """Return one table with the trials and the healthy use of all `tables`."""
    return FaultTable(
        tuple(trial for table in tables for trial in table.trials),
        tuple(life for table in tables for life in table.healthy),
    )
