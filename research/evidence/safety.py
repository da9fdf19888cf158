"""Single faults on robots that somebody wears, healthy hours, nonsense, and what a supervisor costs.

``python -m research.evidence.safety`` writes the results file and its pages, with ``--page`` the pages alone.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pellucid import _core
from pellucid.controllers.export.c_folder import write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues
from pellucid.controllers.export.microcontroller import measure, missing_tools
from pellucid.controllers.supervised import SupervisedLaw
from pellucid.study.results import ResultRow
from pellucid_lab.safety.fault_table import FAULT_KINDS, FaultTable, draw_worn_robot, fault_table
from pellucid_lab.safety.worn_knee import knee_table
from pellucid_lab.safety.worn_robot import LAWS, WornRobot
from research.benchmarks._size import sized

from . import _exported, _simulation_page, _supervisor_page
from ._arm_faults import ArmOutcome, arm_fault_figures, arm_rows, long_life_rows, long_lives, outcomes
from ._exported_equal import compare_supervisors
from ._parts import run_parts
from ._supervisor_page import FaultFigure, Results, read_results, write_pages, write_results

ROBOT_COUNT = sized(20, smallest=1)
"""Number of simulated robots, and of simulated knees."""

HEALTHY_HOURS = sized(10.5, smallest=0.02)
"""Healthy use of all robots together [h]."""

KNEE_HEALTHY_HOURS = sized(2.0, smallest=0.02)
"""Healthy use of all knees together [h]."""

NONSENSE_CYCLE_COUNT = sized(104_000_000, smallest=100_000)
"""Number of cycles with random input over all laws, each with and without its supervisor, in double and in float."""

READING_ROBOT_COUNT = sized(8, smallest=1)
"""Number of robots, and of knees, whose drives measure as badly as stated: one for each of the eight worst readings."""

READING_HEALTHY_HOURS = sized(2.24, smallest=0.02)
"""Healthy use of robots, and as much of knees, with such measurements [h]."""

MIN_MOVING_SPEED_RAD_S = 0.6
"""Speed from which on an encoder counts as frozen in motion [rad/s]."""

MAX_HARMLESS_ENERGY_J = 1.5
"""Largest excess energy with which an undetected fault of ten seconds still counts as bounded [J]."""

EFFORT_LIMIT_NM = 10.0
"""Effort limit of every law here [N m]."""

ROOT = Path(__file__).parents[2]
"""Root folder of the repository."""


def row(name: str, value: float | None, unit: str, note: str = "") -> ResultRow:
    """A figure of this proof."""
    return ResultRow(name, value, unit, "evidence", "simulated", None, note)


@cache
def measured() -> FaultTable:
    """The table, once a run."""
    return fault_table(ROBOT_COUNT, HEALTHY_HOURS)


@cache
def worn_knees() -> FaultTable:
    """The table of the worn knee, once a run."""
    return knee_table(ROBOT_COUNT, KNEE_HEALTHY_HOURS)


@cache
def worn_arms() -> tuple[ArmOutcome, ...]:
    """Faults of arms of several joints, once a run."""
    return tuple(outcomes())


def rows() -> Iterator[ResultRow]:
    """Every figure: of exported controllers first, then of arms, and of the same laws in the virtual lab."""
    robot = draw_worn_robot(0)
    reading = (READING_ROBOT_COUNT, READING_HEALTHY_HOURS)
    yield from run_parts("safety", {
        "equal supervisors": lambda: [equal_row()],
        "exported controllers": _exported.rows,
        "faults of arms": lambda: arm_rows(worn_arms()),
        "long lives of arms": lambda: long_life_rows(long_lives()),
        "faults of elbows": lambda: fault_rows(measured()),
        "faults of knees": lambda: knee_rows(worn_knees()),
        "readings of elbows": lambda: reading_rows("elbow", fault_table(*reading, inexact=True)),
        "readings of knees": lambda: reading_rows("knee", knee_table(*reading, inexact=True)),
        "overspeed": lambda: overspeed_rows(robot),
        "nonsense": lambda: fuzz_rows(robot),
        "heap": heap_rows,
        "cost": lambda: cost_rows(robot),
    })  # fmt: skip


def equal_row() -> ResultRow:
    """Whether the supervisor that is exported is the one that the lab measures."""
    count, differing = compare_supervisors()
    said = ", ".join(f"{law} {name}" for law, name, *_ in differing[:4]) or "every number equal"
    return row("safety.exported.equal_to_measured", float(not differing), "1", f"{count} laws; {said}")


def fault_rows(table: FaultTable) -> Iterator[ResultRow]:
    """Yield the results of single faults and of healthy use."""
    hidden = {kind.name for kind in FAULT_KINDS if kind.hidden}
    shown = [t for t in table.trials if t.kind not in hidden and not t.early]
    note = (
        f"{len(shown)} runs, {len(FAULT_KINDS) - len(hidden)} kinds, {len(LAWS)} laws, {ROBOT_COUNT} simulated robots"
    )
    yield row(
        "safety.single_fault.count", len(FAULT_KINDS), "1", f"{len(hidden)} of them no sensor of the robot can show"
    )
    loose = [t for t in shown if np.isnan(t.found) and t.excess > MAX_HARMLESS_ENERGY_J]
    yield row(
        "safety.single_fault.undetected_unbounded",
        len(loose),
        "1",
        f"{note}; bounded: up to {MAX_HARMLESS_ENERGY_J} J in 10 s",
    )
    worst = max(shown, key=lambda t: t.excess)
    yield row(
        "safety.single_fault.worst_excess_energy", worst.excess, "J",
        f"{note}; positive work on the limb over the same run without the fault; {worst.kind}, {worst.law}",
    )  # fmt: skip
    robots = [t for t in shown if group_of(t.kind) != "wearer"]
    worst = max(robots, key=lambda t: t.peak)
    yield row(
        "safety.single_fault.peak",
        worst.peak,
        "N*m",
        f"in the strap until safe; {worst.kind}, {worst.law}; limit {EFFORT_LIMIT_NM:g}",
    )
    for kind in FAULT_KINDS:
        if kind.hidden:
            trials = table.trials_of(kind.name)
            yield row(f"safety.hidden.{kind.name}.energy", max(t.excess for t in trials), "J",
                      f"{kind.hidden}; found in {sum(t.found == t.found for t in trials)} of {len(trials)}"
            )  # fmt: skip
            yield row(f"safety.hidden.{kind.name}.peak", max(t.peak for t in trials), "N*m", "in the strap, over 10 s")
    frozen = [t for t in table.trials_of("encoder_frozen") if t.onset_speed >= MIN_MOVING_SPEED_RAD_S]
    late = max((1e3 * t.found if t.found == t.found else np.inf for t in frozen), default=np.nan)
    yield row(
        "safety.freeze.detected_after",
        late,
        "ms",
        f"{len(frozen)} runs in which the motor moved at {MIN_MOVING_SPEED_RAD_S} rad/s or more",
    )
    starts = [t for t in table.trials if t.kind.endswith("_at_start")]
    yield row(
        "safety.start_up.impulse",
        max(t.impulse for t in starts),
        "N*m*s",
        f"of the drive until safe, {len(starts)} runs",
    )
    yield row(
        "safety.start_up.missed",
        sum(t.fault not in ("polarity", "gain") for t in starts),
        "1",
        "wrong polarity or gain",
    )
    alarms = sum(life.alarm != "none" for life in table.healthy) + sum(t.early for t in table.trials)
    hours = sum(life.hours for life in table.healthy)
    note = "wearers with tremor and sudden stops; starts of all runs included"
    yield row("safety.lab.false_alarms", alarms, "1", note)
    yield row("safety.lab.healthy_hours", hours, "h", f"{len(table.healthy)} stretches, all laws on all robots")


def knee_rows(table: FaultTable) -> Iterator[ResultRow]:
    """What single faults came to on a worn knee."""
    hidden = {kind.name for kind in FAULT_KINDS if kind.hidden}
    shown = [t for t in table.trials if t.kind not in hidden and not t.early]
    kinds = {t.kind for t in shown}
    note = f"{len(shown)} runs, {len(kinds)} kinds, {len({t.law for t in shown})} laws, {ROBOT_COUNT} simulated wearers"
    loose = [t for t in shown if np.isnan(t.found) and t.excess > MAX_HARMLESS_ENERGY_J]
    which = ", ".join(sorted({t.kind for t in loose})) or "none"
    yield row("safety.knee.count", len(kinds), "1", note)
    yield row("safety.knee.undetected_unbounded", len(loose), "1", f"above {MAX_HARMLESS_ENERGY_J} J in 10 s: {which}")
    for name, of, unit in (("worst_excess_energy", "excess", "J"), ("peak", "peak", "N*m")):
        robots = [t for t in shown if group_of(t.kind) != "wearer"]
        worst = max(robots, key=lambda t: getattr(t, of))
        yield row(f"safety.knee.{name}", getattr(worst, of), unit, f"{worst.kind}, {worst.law}")
    # What goes before a fault is the beginning of the same wearer's and law's healthy life: one alarm, however often.
    alarms = {(life.robot, life.law) for life in table.healthy if life.alarm != "none"}
    alarms |= {(t.robot, t.law) for t in table.trials if t.early}
    hours = sum(life.hours for life in table.healthy)
    yield row("safety.knee.false_alarms", len(alarms), "1", f"{hours:.3g} h of swinging; one life a wearer and law")


def reading_rows(name: str, table: FaultTable) -> Iterator[ResultRow]:
    """Yield the figures of robots by `name` whose drives measure as inaccurately as stated."""
    alarms = {(life.robot, life.law) for life in table.healthy if life.alarm != "none"}
    alarms |= {(t.robot, t.law) for t in table.trials if t.early}
    note = "gain 5 %, offset and noise 1 % of the limit, lag 0.3 or 2 ms"
    yield row(f"safety.drive_reading.{name}.false_alarms", len(alarms), "1", note)
    hours = sum(life.hours for life in table.healthy)
    yield row(f"safety.drive_reading.{name}.healthy_hours", hours, "h", f"{len(table.healthy)} stretches")
    hidden = {kind.name for kind in FAULT_KINDS if kind.hidden}
    drives = [t for t in table.trials if group_of(t.kind) == "drive" and t.kind not in hidden and not t.early]
    missed = [t for t in drives if np.isnan(t.found)]
    which = ", ".join(sorted({t.kind for t in missed})) or "none"
    yield row(f"safety.drive_reading.{name}.missed", len(missed), "1", f"of {len(drives)} faults of drives: {which}")
    worst = max(missed, key=lambda t: t.excess, default=None)
    yield row(f"safety.drive_reading.{name}.missed_energy", worst.excess if worst else 0.0, "J",
              f"in 10 s; {worst.kind}, {worst.law}" if worst else "nothing was missed")  # fmt: skip


def group_of(kind: str) -> str:
    """Return the group of a fault by its name."""
    return next(k.group for k in FAULT_KINDS if k.name == kind)


def overspeed_rows(worn: WornRobot) -> Iterator[ResultRow]:
    """How many periods a joint is too fast before every law's supervisor has acted, at any acceleration."""
    most = 0
    for name in LAWS:
        law = worn.law(name, start_up=False, drive_expected=0.0, force_expected=0.0, muscle_expected=0.0,
                       body_inertia=0.0, range_min=-1e3, range_max=1e3)  # fmt: skip
        for acceleration in (50.0, 100.0, 263.0, 472.0, 900.0, 1500.0):
            most = max(most, _late(law, acceleration))
    yield row("safety.overspeed.detected_after", most, "1", "periods; every law, 50 to 1500 rad/s^2")


def _late(law: SupervisedLaw, acceleration: float) -> int:
    running, limit, position, late = law.start(), law.supervision["raw_speed_limit"], 0.5, 0
    for k in range(1000):
        speed = acceleration * 1e-3 * max(k - 20, 0)
        position += 1e-3 * speed
        running.step(1e-3 * k, position, *[0.0] * (len(law.sensors) - 1))
        if running.fault != "none":
            return late
        # Half a count is what a raw difference cannot tell.
        late += speed > limit + 2e3 * law.supervision["encoder_resolution"]
    return 1000


def fuzz_rows(worn: WornRobot) -> Iterator[ResultRow]:
    """Commands among nonsense."""
    each = NONSENSE_CYCLE_COUNT // (4 * len(LAWS))

    def jobs() -> Iterator[partial]:
        for number, name in enumerate(LAWS):
            law = worn.law(name)
            for single in (False, True):
                yield partial(_core.fuzz_law, law.kind, law.parameters, each, 100 + number, single)
                safe = law.changed(reset_delay=0.02, healthy_samples=20.0, test_least=-1.0, test_most=1e9)
                yield partial(_core.fuzz_supervised, law.kind, law.parameters, safe.supervisor, each, number, single)

    with ThreadPoolExecutor(2) as pool:
        told = list(pool.map(lambda job: job(), jobs()))
    moving = sum(t[3] if i % 2 == 0 else t[2] for i, t in enumerate(told))
    faults = sum(t[1] for t in told)
    note = f"{faults} faults, {sum(t[3] for t in told[1::2])} resets, {moving} cycles with an effort"
    yield row(
        "safety.unsafe", sum(t[0] for t in told), "1", f"beyond limits, not finite, or power while latched; {note}"
    )
    yield row(
        "safety.fuzzed_cycles", each * len(told), "1", "each law alone and under its supervisor, double and float"
    )


def heap_rows() -> Iterator[ResultRow]:
    """What the core asks of the heap while it runs."""
    compiler = shutil.which("c++")
    if compiler is None:
        yield row("safety.heap_operations", None, "1", "c++ is not installed")
        return
    with TemporaryDirectory() as folder:
        program = Path(folder) / "heap"
        wrapped = [f"-Wl,--wrap={name}" for name in ("malloc", "calloc", "realloc")]
        source = ROOT / "tests" / "core" / "heap_test.cpp"
        subprocess.run(
            [compiler, "-std=c++17", "-O1", "-ffp-contract=off", "-fno-exceptions", "-fno-rtti",
             f"-I{ROOT / 'include'}",
             str(source), *wrapped, "-o", str(program)], check=True,
        )  # fmt: skip
        said = subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
    counted = int(said.split("cycles: ")[1].split()[0])
    yield row(
        "safety.heap_operations", counted, "1", "every law and its supervisor, 100,000 steps each, malloc counted"
    )


def cost_rows(worn: WornRobot) -> Iterator[ResultRow]:
    """Time and instructions that a supervisor adds to a step."""
    law = worn.law("force_sensor", start_up=False, wearer_torque=np.inf, wearer_push=np.inf, force_tolerance=np.inf,
                   force_burst=np.inf, force_excess=np.inf, budget_store=np.inf, push_limit=np.inf,
                   power_limit=np.inf, ringing_limit=np.inf)  # fmt: skip
    added = _core.time_supervisor(law.kind, law.parameters, law.supervisor, 20_000, 60)
    yield row(
        "supervisor.step",
        added,
        "ns",
        "double, this machine; mean over 20,000 steps, least of 60 turns; every check at work",
    )
    absent = missing_tools()
    if absent:
        yield row("supervisor.m4.instructions", None, "1", f"not installed: {', '.join(absent)}")
        return
    values = ControllerValues(law.kind, law.law.values, {}, (), {}, uses=law.law.uses)
    with TemporaryDirectory() as folder:
        whole = write_c_folder("evidence", values, Path(folder) / "whole")
        watched = measure(whole)
        bare = measure(without_supervisor(whole))
    yield row("supervisor.m4.instructions", watched.instructions - bare.instructions, "1",
              f"Cortex-M4F, QEMU; {watched.instructions:.0f} with, {bare.instructions:.0f} without")  # fmt: skip
    yield row(
        "supervisor.m4.wrong",
        watched.wrong,
        "1",
        f"of {watched.steps} steps with every fault, bits that differ from here",
    )
    yield row("supervisor.m4.bytes", watched.bytes - bare.bytes, "B", "code and configuration")


def without_supervisor(folder: Path) -> Path:
    """A copy of an exported folder whose step is the law's alone: only to be counted."""
    copy = Path(shutil.copytree(folder, folder.parent / "bare"))
    source = copy / "pellucid_controller.cpp"
    text = source.read_text(encoding="utf-8")
    called = "const p::SupervisorOutput<float> out = p::step(c, samples_of(read), back, read.now_us);"
    if called not in text:
        raise AssertionError(f"{source}: found no call of the supervisor")
    alone = (
        "(void)back; const float effort = p::step(c.controller, samples_of(read), read.now_us); "
        "const p::SupervisorOutput<float> out{effort, c.controller.steps, 0, c.controller.fault, p::Mode::running, "
        "true};"
    )
    source.write_text(text.replace(called, alone), encoding="utf-8")
    return copy


def fault_figures() -> Iterator[FaultFigure]:
    """Yield what became of every fault on every kind of robot."""
    yield from _exported.fault_figures()
    yield from arm_fault_figures(worn_arms())
    kinds = {kind.name: kind for kind in FAULT_KINDS}
    yield from _supervisor_page.fault_figures("lab_elbow", measured().trials, kinds)
    yield from _supervisor_page.fault_figures("lab_knee", worn_knees().trials, kinds)


if __name__ == "__main__":
    if sys.argv[1:] != ["--page"]:
        write_results(Results(tuple(rows()), tuple(fault_figures())))
    write_pages(read_results())
    _simulation_page.write_page()
