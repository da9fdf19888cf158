"""Lives, starts and single faults of exported controllers on foreign plants, and what they came to."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pellucid import _core
from pellucid.controllers.supervised import PROBE_ANSWER_NAMES, commissioned_answers
from pellucid.controllers.supervised import commissioned_bounds as bounds_of_answer
from pellucid_lab.safety.fault_table import FAULT_KINDS, FaultKind

from .exports import ExportedLaw
from .foreign_people import (
    ALARM_FIELDS,
    FAULT_NAMES,
    RESULT_FIELDS,
    RUN_FIELDS,
    TRACE_FIELDS,
    draw_run,
    with_mishaps,
)  # fmt: skip

WATCH_S = 10.0
"""Time after its onset for which a fault is watched that nothing finds."""

ONSETS_S = (2.5, 5.0)
"""Earliest and latest onset of a fault that is not there from the start; wearers move from 1.6 s on at the earliest."""

REFERENCE_TAIL_S = 0.1
"""Time by which the run without a fault outlasts those with one."""

MIN_EFFECT_J = 0.05
"""Excess energy from which a fault has an effect; a reaction of the supervisor or `MIN_EFFECT_SHARE` also shows one."""

MIN_EFFECT_SHARE = 0.05
"""Mean difference between the drive's effort and that of the healthy run from which a fault has an effect.

It is a share of the effort limit, until the output is safe or the observation ends."""

COMMISSIONING_S = 3.0
"""Duration of the run in which a robot is commissioned."""

PROBE_COMMISSIONING_S = 20.0
"""Duration of the run in which a probe's answers are taken at commissioning."""

COMMISSIONING_FRICTION = (0.7, 1.4)
"""Smallest and largest ratio of the friction on the day of the commissioning to that of the day of the trial [1]."""

COMMISSIONING_INDEX = 10_000
"""Distance of the index of the wearer on whom a robot is commissioned from that of the wearer who then wears it."""

WEARER_PREFIXES = ("upper_cuff", "lower_cuff", "cuff_", "limb_", "servo_", "reflex_", "activation", "anticipation",
                   "learning")  # fmt: skip
"""Beginnings of the names of a run's numbers that belong to the wearer and to the strap."""

START_S = 20.0
"""Time for which a law must run without an alarm to count as started."""

MODE_NAMES = tuple(_core.MODES)
"""Names of the supervisor's modes, in the order of their numbers."""

SINE_AMPLITUDES_NM = (1.5, 3.0, 5.0)
"""Amplitudes of the sine of 2.5 Hz that a drive adds."""

EXTRA_KINDS: Mapping[str, FaultKind] = {
    kind.name: kind
    for kind in (
        FaultKind("drive_double", "drive", "the drive gives twice the effort and reports it", "", False, False, ""),
        FaultKind("drive_sine", "drive", "the drive adds a sine of 2.5 Hz and reports it", "", False, False, ""),
    )
}
"""Faults that the core's list does not have."""

KINDS: Mapping[str, FaultKind] = {kind.name: kind for kind in FAULT_KINDS} | EXTRA_KINDS
"""Every fault by name that all laws are tried with."""

SPECIAL_KINDS: Mapping[str, FaultKind] = {
    kind.name: kind
    for kind in (
        FaultKind("drive_lies", "drive", "the drive adds a sine of 2.5 Hz, and says that it does not", "", False, False,
                  "a wearer could move so"),
        FaultKind("current_spike", "drive", "one reading of the drive is wrong", "", False, False, ""),
        FaultKind("encoder_frozen_at_rest", "sensor", "the encoder freezes at rest", "", False, False, ""),
        FaultKind("rate_half", "clock", "the task runs every second period", "", False, False, ""),
        FaultKind("rate_quarter", "clock", "the task runs every fourth period", "", False, False, ""),
        FaultKind("rate_double", "clock", "the task runs twice as often", "", False, False, ""),
        FaultKind("rate_twice", "clock", "the task is called twice a period", "", False, False, ""),
    )
}  # fmt: skip
"""Faults that only rows of their own try."""


@dataclass(frozen=True)
class ForeignTrial:
    """One fault under one exported law on one foreign plant."""

    kind: str
    law: str
    plant: int  # index of the draw
    amplitude: float  # of an added sine [N m]; 0 for every other fault
    early: bool  # whether the supervisor acted before the onset
    found: float  # time from the onset until the supervisor or the watchdog acted [s]; NaN for never
    safe: float  # time from the onset until the output was safe [s]; NaN for never
    fault: str  # fault that the supervisor named
    mode: str  # its mode at the end
    excess: float  # [J]
    peak: float  # largest torque of the strap until safe [N m]
    deviation: float  # mean difference of the drive's effort from the healthy run's [N m]
    effort_limit: float  # of the law [N m]

    @property
    def is_found(self) -> bool:
        """Whether the supervisor or the watchdog acted within ten seconds."""
        return self.found == self.found

    @property
    def did_something(self) -> bool:
        """Whether the fault changed what the wearer felt or the drive gave, or was found."""
        return self.is_found or self.excess >= MIN_EFFECT_J or self.deviation >= MIN_EFFECT_SHARE * self.effort_limit


@dataclass(frozen=True)
class LifeAlarm:
    """One time at which the supervisor acted in a healthy life."""

    law: str
    plant: int
    time: float  # [s]
    fault: str
    before: str  # mode before it
    event: str  # what the wearer did in the half second before
    speed: float  # largest true speed in the half second before [rad/s]
    lowest: float  # lowest true position [rad]
    highest: float  # highest true position [rad]
    push: float  # largest true torque of the wearer on the robot [N m]
    lasting: float  # largest true torque of the wearer that lasts, smoothed with 5/s [N m]
    wanted: str  # reason for which a person would want it; "" for a false alarm


@dataclass(frozen=True)
class ForeignLife:
    """A healthy life of one exported law on one foreign plant."""

    law: str
    plant: int
    hours: float  # duration [h]
    running: float  # part of it with the law in force [h]
    started: float  # time until the law was first in force [s]; NaN for never
    alarms: tuple[LifeAlarm, ...]
    reached: float  # mean distance from targets at the end of pauses [rad]
    ringing: float  # mean change of the effort in a period [N m]

    @property
    def false_alarms(self) -> int:
        """Number of alarms that nobody would want."""
        return sum(not alarm.wanted for alarm in self.alarms)


EVENT_NAMES = ("reach", "sudden stop", "impact", "load", "spasm", "taken off or put on")
"""What a wearer does, in the order of the program's numbers."""


def wanted_reason(
    run: Mapping[str, float], *, event: str, speed: float, lowest: float, highest: float, push: float, lasting: float
) -> str:
    """Return why a person would want an alarm, or "".

    The rule, written down before any alarm was counted: in the half second before the alarm the joint was truly faster
    than the stated velocity limit, or truly outside the range of positions that the export accepts, or the wearer truly
    pushed the robot harder, in a spasm or an impact, than the export says that a wearer does at once or lastingly.
    """
    if speed > run["velocity_limit"]:
        return "faster than the velocity limit"
    if lowest < run["range_low"] or highest > run["range_high"]:
        return "outside the range of positions"
    if event in ("spasm", "impact") and push > run["wearer_push"]:
        return f"{event} that pushes harder than a wearer's largest momentary torque"
    if event in ("spasm", "impact") and lasting > run["wearer_torque"]:
        return f"{event} that pushes harder than a wearer's largest lasting torque"
    return ""


@dataclass(frozen=True)
class PlayedRun:
    """What the program told of one run."""

    result: dict[str, float]  # numbers by name
    alarms: np.ndarray  # a row for each alarm, shape (k, 9)
    trace: np.ndarray  # a row for every second period of a traced run, shape (t, 5)


def play(program: ExportedLaw, runs: Sequence[Mapping[str, float]]) -> list[PlayedRun]:
    """Return what the program told of every run."""
    given = np.array([[run[name] for name in RUN_FIELDS] for run in runs], dtype=np.float64)
    done = subprocess.run([str(program.program)], input=given.tobytes(), capture_output=True, check=True)
    numbers, at, results = np.frombuffer(done.stdout, dtype=np.float64), 0, []
    size, width = len(RESULT_FIELDS), len(ALARM_FIELDS)
    for _ in runs:
        result = dict(zip(RESULT_FIELDS, map(float, numbers[at : at + size]), strict=True))
        at += size
        tables = []
        for columns in (width, len(TRACE_FIELDS)):
            count = int(numbers[at])
            tables.append(numbers[at + 1 : at + 1 + count * columns].reshape(count, columns))
            at += 1 + count * columns
        results.append(PlayedRun(result, *tables))
    return results


def play_all(jobs: Sequence, workers: int = 2) -> Iterator:
    """Yield what functions without arguments return, of which `workers` run at once: each is a process of its own."""
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(lambda job: job(), jobs)


def seconds_or_nan(value: float) -> float:
    """Return a time, or NaN where the program says that it never was."""
    return value if value >= 0.0 else float("nan")


def can_have(law: ExportedLaw, kind: FaultKind) -> bool:
    """Return whether a law can have a fault: it uses the sensor, and the fault does not need a second encoder."""
    if kind.joint_encoder or (kind.needs and kind.needs not in law.uses):
        return False
    measured = law.numbers["drive_expected"] > 0.0
    return measured or not kind.name.startswith("current_")


def fault_runs(
    law: ExportedLaw,
    index: int,
    seed: int,
    kinds: Sequence[str],
    *,
    commissioned: bool = True,
) -> tuple[list[dict[str, float]], list[tuple[str, float]]]:
    """Return runs of faults by name under one law on the plant of an index, with each fault's name and amplitude.

    The first run is the reference without a fault. Start-up test and probe know what the robot answered then if it was
    `commissioned`.
    """
    base = draw_run(law, index, seed)
    base["brace_interval"] = with_mishaps(base, seed, index)["brace_interval"]
    if commissioned:
        base |= commissioned_numbers(law, base, seed, index)
    runs, said = [{**base, "kind": 0.0, "seconds": ONSETS_S[1] + WATCH_S + REFERENCE_TAIL_S}], []
    for name in kinds:
        kind = (KINDS | SPECIAL_KINDS)[name]
        if not can_have(law, kind):
            continue
        number = FAULT_NAMES.index(name)
        for amplitude in amplitudes_of(name):
            rng = np.random.default_rng([seed, index, number, sum(map(ord, law.name))])
            onset = 0.0 if kind.at_start else round(float(rng.uniform(*ONSETS_S)) / base["period"]) * base["period"]
            drawn = float(rng.integers(1, 2**48))
            runs.append({**base, "kind": float(number), "onset": onset, "seconds": WATCH_S, "fault_seed": drawn,
                         "amplitude": amplitude * base["drive_strength"]})  # fmt: skip
            said.append((name, amplitude))
    return runs, said


def amplitudes_of(kind: str) -> tuple[float, ...]:
    """Return the amplitudes with which a fault is tried on an elbow [N m]; 0 for a fault without one."""
    return {"drive_sine": SINE_AMPLITUDES_NM, "drive_lies": SINE_AMPLITUDES_NM[-1:]}.get(kind, (0.0,))


def try_faults(
    law: ExportedLaw,
    index: int,
    seed: int,
    kinds: Sequence[str],
    **conditions: bool,
) -> list[ForeignTrial]:
    """Try faults by name under one law on the plant of an index, under the `conditions` of `fault_runs`."""
    runs, said = fault_runs(law, index, seed, kinds, **conditions)
    played = play(law, runs)
    return [
        ForeignTrial(
            name, law.name, index, amplitude, result["early"] >= 0.0, seconds_or_nan(result["found"]),
            seconds_or_nan(result["safe"]), fault_name(result["fault"]), MODE_NAMES[int(result["mode"])],
            result["excess"], result["peak"], result["deviation"], runs[0]["effort_limit"],
        )
        for (name, amplitude), result in zip(said, (run.result for run in played[1:]), strict=True)
    ]  # fmt: skip


def commissioned_numbers(law: ExportedLaw, run: Mapping[str, float], seed: int, index: int) -> dict[str, float]:
    """Return what is known of a robot that was commissioned: nothing where neither drive nor probe is measured."""
    made: dict[str, float] = {}
    if law.numbers["drive_expected"] > 0.0 or law.numbers["probe_effort"] > 0.0:
        made |= commissioned_bounds(law, run, seed, index)
    return made | commissioned_probe(law, run, seed, index)


def commissioned_bounds(law: ExportedLaw, run: Mapping[str, float], seed: int, index: int) -> dict[str, float]:
    """Return the bounds of the test at start-up of a robot that was commissioned on another wearer, without tremor."""
    other = draw_run(law, index + COMMISSIONING_INDEX, seed)
    person = {name: value for name, value in other.items() if name.startswith(WEARER_PREFIXES)}
    commissioned = {**run, **person, "tremor_amplitude": 0.0, "kind": 0.0, "seconds": COMMISSIONING_S}
    result = play(law, [commissioned])[0].result
    if not result["answer"] > 0.0:
        return {}
    return dict(zip(("test_least", "test_most"), bounds_of_answer(result["answer"]), strict=True))


def commissioned_probe(law: ExportedLaw, run: Mapping[str, float], seed: int, index: int) -> dict[str, float]:
    """Return what a robot answered its probe on another wearer, in another posture and with other friction."""
    if not law.numbers["probe_effort"] > 0.0:
        return {}
    result = play(law, [commissioning_run(law, run, seed, index)])[0].result
    if not result["probe_windows"] > 0.0:
        return {}
    return dict(commissioned_answers([result[f"seen_{name}"] for name in PROBE_ANSWER_NAMES]))


def commissioning_run(law: ExportedLaw, run: Mapping[str, float], seed: int, index: int) -> dict[str, float]:
    """Return the run in which a probe's answers are taken on the plant of a run, from a wearer without tremor."""
    other = draw_run(law, index + COMMISSIONING_INDEX, seed)
    person = {name: value for name, value in other.items() if name.startswith(WEARER_PREFIXES)}
    rng = np.random.default_rng([seed, index, COMMISSIONING_INDEX])
    rough = float(rng.uniform(*COMMISSIONING_FRICTION))
    friction = {name: rough * run[name] for name in ("friction_positive", "friction_negative", "viscous")}
    return {**run, **person, **friction, "start_position": other["start_position"], "tremor_amplitude": 0.0,
            "kind": -1.0, "brace_interval": 0.0, "seconds": PROBE_COMMISSIONING_S}  # fmt: skip


def fault_name(number: float) -> str:
    """Return the name of the supervisor's fault of a number; -1 stands for the drive's watchdog."""
    return "watchdog" if number < 0.0 else _core.FAULTS[int(number)]


def live(law: ExportedLaw, index: int, seed: int, seconds: float, *, mishaps: bool = True,
         **changed: float) -> ForeignLife:  # fmt: skip
    """Return a healthy life of a law on the plant of an index, with a wearer's mishaps or without."""
    run = draw_run(law, index, seed)
    if mishaps:
        run = with_mishaps(run, seed, index)
    run |= commissioned_numbers(law, run, seed, index)
    run |= {"kind": -1.0, "seconds": seconds, **changed}
    return life_of(law, index, run, play(law, [run])[0])


def life_of(law: ExportedLaw, index: int, run: Mapping[str, float], played: PlayedRun) -> ForeignLife:
    """Return a healthy life from what the program said of it."""
    alarms, result = [], played.result
    for row in played.alarms:
        said = dict(zip(ALARM_FIELDS, map(float, row), strict=True))
        seen = {name: said[name] for name in ("speed", "lowest", "highest", "push", "lasting")}
        event = EVENT_NAMES[int(said["event"])]
        alarms.append(
            LifeAlarm(
                law.name, index, said["time"], fault_name(said["fault"]), MODE_NAMES[int(said["before"])], event,
                **seen, wanted=wanted_reason(run, event=event, **seen),
            )
        )  # fmt: skip
    return ForeignLife(
        law.name, index, result["lived"] / 3600.0, result["running"] / 3600.0, seconds_or_nan(result["started"]),
        tuple(alarms), result["reached"], result["ringing"],
    )  # fmt: skip


def try_starts(law: ExportedLaw, wearers: int, postures: int, seed: int) -> list[ForeignLife]:
    """Start a law with every wearer in postures that cover the range of targets evenly; each runs for `START_S`."""
    runs = []
    for index in range(wearers):
        run = draw_run(law, index, seed)
        for posture in np.linspace(run["target_low"], run["target_high"], postures):
            runs.append((index, {**run, "kind": -1.0, "seconds": START_S, "start_position": float(posture)}))
    played = play(law, [run for _, run in runs])
    return [life_of(law, index, run, one) for (index, run), one in zip(runs, played, strict=True)]
