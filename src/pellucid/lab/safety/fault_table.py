"""Every single fault on every law, on drawn robots and wearers: found or bounded, how soon, what it did till then."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ..._processes import ordered_results
from ...control.supervised import SupervisedLaw
from ..drive_reading import stated_readings
from ..elbow.rig import able_elbow, drawn_rigs
from ..pointing.conditions import identify_cards
from ..pointing.people import draw_people
from ..pointing.rig import elbow_participants
from .worn_robot import LAWS, WornRobot, draw_sudden_stops, make_worn_robot

JUDGED_SEED = 20290115
"""Of the robots that are judged. Thresholds were chosen on `law_comparison.tuning_robots`, more of their seed, and
robots of 20281101, 20281103, 20281105 and 20281107."""

MAX_WATCH_S = 10.0
"""How long a fault is watched that nothing finds [s]."""

ONSET_RANGE_S = (2.0, 5.0)
"""When a fault begins that is not there from the start [s]."""

ONSET_STEP_S = 0.05
"""How far an onset is rounded [s]."""


APPROACHED_THRESHOLDS = {
    "lasting": "wearer_torque", "push": "wearer_push", "contradiction": "force_tolerance", "burst": "force_burst",
    "excess": "force_excess", "spent": "budget_store", "ringing": "ringing_limit",
    "surplus": "drive_surplus",
}  # fmt: skip
"""What a healthy life says of how near it came to a threshold, and that threshold's name."""


@dataclass(frozen=True)
class FaultKind:
    """A fault of the core's list; `hidden` says why no sensor of the robot can show it, "" where one can."""

    name: str
    group: str
    sentence: str
    needs: str
    at_start: bool
    joint_encoder: bool
    hidden: str


FAULT_KINDS: tuple[FaultKind, ...] = tuple(FaultKind(**kind) for kind in _core.single_faults())
"""Every single fault, in the core's order."""


@dataclass(frozen=True)
class FaultTrial:
    """What one fault came to on one law of one robot."""

    kind: str
    law: str
    robot: int
    early: bool  # Whether the supervisor acted before there was a fault
    found: float  # found, safe: From the onset until it acted, and until the output was safe [s]; NaN for never
    safe: float
    fault: str  # What it found
    mode: str  # What it did
    excess: float  # Positive work on the limb over that of the same run without the fault, the most until safe [J]
    peak: float  # Of the strap's torque until safe [N m]
    impulse: float  # Of the drive until safe [N m s]
    onset_speed: float  # Of the motor [rad/s]


@dataclass(frozen=True)
class HealthyLife:
    """A stretch of healthy use of one law on one robot."""

    law: str
    robot: int
    hours: float
    alarm: str  # "none", or what was found though nothing was wrong
    energy: float  # Positive work on the limb a second [W]
    # Largest before any alarm, by the name of the threshold that it did not pass, as a share of that
    nearest: Mapping[str, float]


@dataclass(frozen=True)
class FaultTable:
    """All trials, and all healthy use."""

    trials: tuple[FaultTrial, ...]
    healthy: tuple[HealthyLife, ...]

    def of(self, kind: str) -> tuple[FaultTrial, ...]:
        """Trials of a fault by name."""
        return tuple(trial for trial in self.trials if trial.kind == kind)


def draw_worn_robot(index: int, seed: int = JUDGED_SEED) -> WornRobot:
    """A robot and a wearer; with the seed that is meant one that no threshold was chosen on."""
    robot = drawn_rigs(able_elbow(), index + 1, seed=seed)[index]
    rig = elbow_participants(robot)
    wearer, other = draw_people(rig, np.random.default_rng([seed, index]), count=6)[:2]
    worn = make_worn_robot(rig, wearer, identify_cards(robot), seed + index)
    return worn.commissioned(other)


def try_robot(worn: WornRobot, index: int, hours: float, laws: Sequence[str] = LAWS) -> FaultTable:
    """Every fault that a robot and its `laws` can have, and some `hours` of healthy use, shared among the laws."""
    trials, healthy = [], []
    for name in laws:
        trials += try_law(worn, index, name, worn.law(name))
        seconds = 3600.0 * hours / len(laws)
        stops = draw_sudden_stops(seconds, np.random.default_rng([index, 3]))
        lived = worn.live(worn.law(name), longest=seconds, seconds=np.inf, stops=stops)
        energy = lived["energy"][-1] if len(lived["energy"]) else 0.0
        took = lived["periods"] * worn.rig.period
        near = {
            threshold: lived[said] / worn.law(name).supervision[threshold]
            for said, threshold in APPROACHED_THRESHOLDS.items()
        }
        healthy.append(HealthyLife(name, index, took / 3600.0, lived["fault"], float(energy) / took, near))
    return FaultTable(tuple(trials), tuple(healthy))


def try_law(worn: WornRobot, index: int, name: str, law: SupervisedLaw) -> Iterator[FaultTrial]:
    """Every fault that a robot of an index can have under a supervised law of a name."""
    period = worn.rig.period
    two = law.changed(joint_expected=1.0)
    longest = ONSET_RANGE_S[1] + MAX_WATCH_S + 1.0
    stops = draw_sudden_stops(longest, np.random.default_rng([index, 5]))
    every = 5.0 * period  # of the energy that the core returns
    healthy = worn.live(law, longest=longest, seconds=np.inf, stops=stops)["energy"]
    for number, kind in enumerate(FAULT_KINDS):
        if kind.needs and kind.needs not in law.law.uses:
            continue
        rng = np.random.default_rng([index, number, sum(map(ord, name))])
        onset = 0.0 if kind.at_start else round(rng.uniform(*ONSET_RANGE_S) / ONSET_STEP_S) * ONSET_STEP_S
        lived = worn.live(
            two if kind.joint_encoder else law, kind.name, onset=onset, seconds=MAX_WATCH_S, longest=longest,
            stops=stops, seed=int(rng.integers(1, 2**60)),
        )  # fmt: skip
        begin, faulty = round(onset / every), lived["energy"]
        n = min(len(faulty), len(healthy) - begin)
        same = healthy[begin : begin + n] - (healthy[begin - 1] if n > 0 and begin else 0.0)
        yield FaultTrial(
            kind.name,
            name,
            index,
            lived["early"] > 0,
            lived["found"] * period if lived["found"] >= 0 else float("nan"),
            lived["safe"] * period if lived["safe"] >= 0 else float("nan"),
            lived["fault"],
            lived["mode"],
            max(float(np.max(faulty[:n] - same)), 0.0) if n > 0 else 0.0,
            lived["peak"],
            lived["impulse"],
            lived["onset_speed"],
        )


def with_stated_reading(worn: WornRobot, index: int) -> WornRobot:
    """The same robot, whose drive measures its effort as inaccurately as stated; the `index` chooses one of eight."""
    readings = stated_readings(worn.law("compensation").values["effort_limit"])
    return replace(worn, reading=readings[index % len(readings)])


def _one_robot_table(index: int, hours: float, seed: int, inexact: bool) -> FaultTable:
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
    """The whole table on so many `robots` of a `seed`, and so many `hours` of healthy use of all laws together.

    Drives measure their effort exactly, or, if `inexact`, each by one of `stated_readings`."""
    made = ordered_results(
        [(_one_robot_table, index, hours / robots, seed, inexact) for index in range(robots)], workers
    )
    return FaultTable(
        tuple(trial for one in made for trial in one.trials), tuple(life for one in made for life in one.healthy)
    )
