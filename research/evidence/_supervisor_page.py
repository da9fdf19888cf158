"""Results of the supervisor's validation, and the pages that are written from them.

`python -m research.evidence.safety` measures and writes `RESULTS_FILE`; with ``--page`` it only writes the pages again.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

from pellucid._atomic import write_text_atomically
from pellucid.study.results import ResultRow
from pellucid_lab.safety.fault_table import FAULT_KINDS, FaultKind

ROOT = Path(__file__).parents[2]
"""Root folder of the repository."""

RESULTS_FILE = Path(__file__).with_name("results") / "supervisor.json"
"""Every figure and every fault that was measured."""

VALIDATION_PAGE = ROOT / "docs" / "validation" / "supervisor.md"
"""Page of the validation, which is generated as a whole."""

EXPLANATION_PAGE = ROOT / "docs" / "explanation" / "supervision.md"
"""Page with a summary of the faults between two marks."""

BEGIN_MARK = "<!-- faults -->"
"""Comment before the generated part of the explanation."""

END_MARK = "<!-- end of faults -->"
"""Comment after the generated part of the explanation."""

CONFIDENCE = 0.95
"""Level of the confidence interval of a detection rate [1]."""

INSTRUMENT_TITLES: Mapping[str, str] = {
    "drive_measured": "Exports with a drive measurement",
    "unmeasured": "Exports without a drive measurement (default: probe, commissioned)",
    "drive_measured_and_probe": "Exports with a drive measurement and a probe",
    "blind": "Exports without a drive measurement and without a probe (baseline)",
    "knee-orthosis": "Default export of a knee orthosis with a series spring",
    "worn-leg_drive_measured": "Worn leg of 44 N·m with a drive measurement",
    "worn-leg_unmeasured": "Worn leg of 44 N·m without a drive measurement (default export)",
    "arm": "Arm of four joints with a second encoder at each joint",
    "arm_one_encoder": "Arm of four joints with one encoder at each joint",
    "lab_elbow": "Elbow of the virtual lab, exact instruments",
    "lab_knee": "Knee orthosis of the virtual lab, exact instruments",
}
"""Headings of the tables of faults, by the name of robot and instruments."""

TABLED_ROBOTS: Mapping[str, str] = {
    "drive_measured": "drive measured",
    "unmeasured": "default export",
    "knee-orthosis": "knee orthosis",
    "arm": "arm, two encoders a joint",
}
"""Robots of the table of all faults, and the headings of their columns."""

SUMMARY_FAULTS = (
    "encoder_frozen", "encoder_flipped", "force_offset", "force_triple", "drive_reversed", "drive_triple",
    "drive_stuck", "drive_dead", "drive_late", "drive_sine", "wearer_spasm", "wearer_faints",
)  # fmt: skip
"""Faults that the explanation lists: of each group the ones with the largest energy, and the usual ones."""

WORST_DRIVE_FAULTS = ("drive_reversed", "drive_triple", "drive_stuck", "drive_dead")
"""Faults with which an export is compared with the baseline."""


@dataclass(frozen=True)
class FaultFigure:
    """What became of one fault on one kind of robot."""

    robot: str  # name in `INSTRUMENT_TITLES`
    fault: str
    sentence: str  # what happens
    hidden: bool  # whether no sensor of the robot can show it
    amplitude: float  # of an added sine [N m]; 0 for every other fault
    runs: int
    effective: int  # runs in which the fault was detected or did something
    detected: int
    median: float | None  # time to detection [s]; None where it was never detected
    latest: float | None  # [s]
    excess: float  # largest excess energy [J]

    @property
    def is_robots(self) -> bool:
        """Whether the robot has the fault, not its wearer."""
        return not self.fault.startswith(("wearer_", "strap_"))

    @property
    def rate(self) -> float:
        """Detection rate among the runs in which the fault did something [%]."""
        return 100.0 * self.detected / self.effective if self.effective else 0.0


@dataclass(frozen=True)
class Results:
    """Everything that was measured."""

    figures: tuple[ResultRow, ...]
    faults: tuple[FaultFigure, ...]

    def value(self, name: str) -> float | None:
        """Return a figure; None where it was not measured."""
        return next((row.value for row in self.figures if row.id == name), None)

    def of(self, robot: str) -> tuple[FaultFigure, ...]:
        """Return the faults of one kind of robot."""
        return tuple(fault for fault in self.faults if fault.robot == robot)

    def detectable(self, robot: str) -> tuple[FaultFigure, ...]:
        """Return the faults of one kind of robot that its sensors can show and that had an effect."""
        return tuple(f for f in self.of(robot) if f.is_robots and not f.hidden and f.effective)


def fault_figures(robot: str, trials: Iterable[Any], kinds: Mapping[str, FaultKind]) -> Iterator[FaultFigure]:
    """Yield the figure of every fault among trials, which have `kind`, `found`, `excess` and `early`."""
    valid = [trial for trial in trials if not trial.early]
    of_kind = dict.fromkeys((trial.kind, getattr(trial, "amplitude", 0.0)) for trial in valid)
    for kind, amplitude in sorted(of_kind, key=lambda each: (tuple(kinds).index(each[0]), each[1])):
        own = [trial for trial in valid if (trial.kind, getattr(trial, "amplitude", 0.0)) == (kind, amplitude)]
        yield fault_figure(
            robot, kind, kinds[kind].sentence, hidden=bool(kinds[kind].hidden), amplitude=amplitude,
            found=[trial.found for trial in own], excess=[trial.excess for trial in own],
            effective=sum(getattr(trial, "did_something", True) for trial in own),
        )  # fmt: skip


def fault_figure(
    robot: str,
    fault: str,
    sentence: str,
    *,
    hidden: bool,
    found: Sequence[float],
    excess: Sequence[float],
    amplitude: float = 0.0,
    effective: int | None = None,
) -> FaultFigure:
    """Return the figure of one fault from its times to detection [s], NaN or negative for never, and energies [J]."""
    times = [time for time in found if time >= 0.0]
    return FaultFigure(
        robot, fault, sentence, hidden, amplitude, len(found), len(found) if effective is None else effective,
        len(times), float(np.median(times)) if times else None, max(times, default=None), float(max(excess)),
    )  # fmt: skip


def write_results(results: Results, path: Path = RESULTS_FILE) -> None:
    """Write the results as JSON."""
    content = {"figures": [asdict(row) for row in results.figures], "faults": [asdict(f) for f in results.faults]}
    path.parent.mkdir(exist_ok=True)
    write_text_atomically(path, json.dumps(content, indent=1) + "\n")


def read_results(path: Path = RESULTS_FILE) -> Results:
    """Return the results of a file."""
    content = json.loads(path.read_text(encoding="utf-8"))
    return Results(
        tuple(ResultRow(**row) for row in content["figures"]), tuple(FaultFigure(**f) for f in content["faults"])
    )


DRIVE_FAULT_WORDS = {
    "drive_reversed": "reversed polarity",
    "drive_triple": "three times the effort",
    "drive_stuck": "effort stuck at a value",
    "drive_dead": "no effort",
    "drive_triple_unseen": "three times the effort, with a current sensor that reads a third",
}
"""Faults of a drive in the words of an export, which quotes what became of them."""


def quoted_figures(results: Results, robot: str, faults: Sequence[str] = WORST_DRIVE_FAULTS) -> tuple[str, ...]:
    """Return detection rate and largest excess energy of some faults of a drive, as an export quotes them."""
    own = {fault.fault: fault for fault in results.of(robot)}
    return tuple(
        f"{DRIVE_FAULT_WORDS[name]}: detected in {own[name].detected} of {own[name].effective} runs, "
        f"up to {own[name].excess:.2g} J"
        for name in faults
    )


def rate_words(detected: int, runs: int) -> str:
    """Return a detection rate with its exact confidence interval (Clopper and Pearson 1934)."""
    if not runs:
        return ""
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = beta.ppf(tail, detected, runs - detected + 1) if detected else 0.0
    high = beta.ppf(1.0 - tail, detected + 1, runs - detected) if detected < runs else 1.0
    return f"{100.0 * detected / runs:.1f} % ({100.0 * low:.1f} to {100.0 * high:.1f} %)"


def milliseconds(time: float) -> str:
    """Return a time in words."""
    return f"{1e3 * time:.0f} ms"


def happens(fault: FaultFigure) -> str:
    """Return what happens in a fault, with a star where no sensor of the robot shows it."""
    amplitude = f", {fault.amplitude:g} N·m" if fault.amplitude else ""
    return fault.sentence.replace("N m", "N·m") + amplitude + (" *" if fault.hidden else "")


def cell(fault: FaultFigure | None, time: float | None, *, with_units: bool = True) -> str:
    """Return detection rate unless it is 100 %, a time to detection and the largest excess energy of a fault."""
    if fault is None:
        return ""
    rate = f"{fault.rate:.0f} %, " if fault.detected < fault.effective else "" if fault.effective else "no effect, "
    after = "" if time is None else f"{milliseconds(time) if with_units else f'{1e3 * time:.0f}'}, "
    return f"{rate}{after}{fault.excess:.2f}{' J' if with_units else ''}"


def rate_over(faults: Sequence[FaultFigure]) -> float:
    """Return the detection rate over all runs in which one of the faults did something [%]."""
    return 100.0 * sum(fault.detected for fault in faults) / sum(fault.effective for fault in faults)


def robot_table(results: Results) -> Iterator[str]:
    """Yield the lines of a table of all kinds of robots: how much of their faults was detected."""
    yield "| robot and instruments | runs | detection rate | fault with the largest excess energy |"
    yield "|---|--:|--:|---|"
    for robot, title in INSTRUMENT_TITLES.items():
        shown = results.detectable(robot)
        if shown:
            worst, rate = max(shown, key=lambda fault: fault.excess), rate_over(shown)
            runs = sum(fault.runs for fault in shown)
            yield f"| {title} | {runs} | {rate:.1f} % | {happens(worst)}: {worst.excess:.2f} J |"


def fault_table(results: Results) -> Iterator[str]:
    """Yield the lines of the table of all faults on the robots of `TABLED_ROBOTS`."""
    by_robot = [{(f.fault, f.amplitude): f for f in results.of(robot)} for robot in TABLED_ROBOTS]
    yield f"| fault | {' | '.join(TABLED_ROBOTS.values())} |"
    yield f"|---|{'---|' * len(TABLED_ROBOTS)}"
    known_faults = {key: fault for faults in reversed(by_robot) for key, fault in faults.items()}
    order = [kind.name for kind in FAULT_KINDS]
    for key in sorted(known_faults, key=lambda each: (order.index(each[0]) if each[0] in order else len(order), each)):
        known = known_faults[key]
        found = [faults.get(key) for faults in by_robot]
        cells = [cell(fault, None if fault is None else fault.latest, with_units=False) for fault in found]
        yield f"| {happens(known)} | {' | '.join(cells)} |"


def comparison(results: Results) -> Iterator[str]:
    """Yield the lines of the table that compares exports with the baseline."""
    robots = ("blind", "unmeasured", "drive_measured")
    yield "| fault of the drive | baseline | default export | with a drive measurement |"
    yield "|---|---|---|---|"
    for name in WORST_DRIVE_FAULTS:
        cells, sentence = [], ""
        for robot in robots:
            found = next((fault for fault in results.of(robot) if fault.fault == name), None)
            cells.append("" if found is None else f"{rate_words(found.detected, found.runs)}; {found.excess:.2f} J")
            sentence = sentence if found is None else happens(found)
        yield f"| {sentence} | {' | '.join(cells)} |"


MILLION, MANY = 1e6, 1e5
"""A million, and the number from which on figures are in millions."""


def number(value: float) -> str:
    """Return a figure with four significant digits."""
    return f"{value:.4g}" if abs(value) < MANY else f"{value / MILLION:.4g} million"


CLAIMS: Sequence[tuple[str, tuple[str, ...]]] = (
    (
        "False alarms with a drive measurement: {} in {} h of healthy use.",
        ("safety.false_alarms", "safety.healthy_hours"),
    ),
    (
        "False alarms with a drive measurement, participants who oscillate, `shaking = false`: {} in {} h.",
        ("safety.to_and_fro.false_alarms", "safety.to_and_fro.healthy_hours"),
    ),
    (
        "False alarms of default exports: {} in {} h of healthy use.",
        ("safety.exported.unmeasured.false_alarms", "safety.exported.unmeasured.healthy_hours"),
    ),
    (
        "False alarms without a drive measurement, participants who oscillate, `shaking = false`: {} in {} h.",
        ("safety.exported.unmeasured.to_and_fro.false_alarms", "safety.exported.unmeasured.to_and_fro.healthy_hours"),
    ),
    (
        "Starts refused by default exports of {} robots: {}.",
        ("safety.default_exports.tried", "safety.default_exports.starts_refused"),
    ),
    (
        "Control task at half, double or a quarter of its rate, or called twice a period: {} % detected within {} s.",
        ("safety.rate.found", "safety.rate.detected_after"),
    ),
    (
        "Time stamps with ±0.2 ms jitter on a 32-bit clock: {} false alarms in {} h.",
        ("safety.rate.false", "safety.rate.healthy_hours"),
    ),
    ("One wrong reading of the drive: {} participants were stopped.", ("safety.spike.stopped",)),
    (
        "Encoder that freezes at rest, default export: {} % detected within 2 s, the last after {} s.",
        ("safety.frozen_encoder.detected_or_unarmed", "safety.frozen_encoder.detected_after"),
    ),
    (
        "Drive that adds a sine and does not measure it: {} % detected, at most {} J.",
        ("safety.drive_lies.found", "safety.drive_lies.worst_excess_energy"),
    ),
    (
        "Robots with compliant straps and a force sensor: {} of {} oscillate.",
        ("safety.soft.oscillating", "safety.soft.robots"),
    ),
    (
        "Commissioning of {} robots: {} wrong signs, largest gain error {} %, largest delay error {} ms.",
        ("safety.commissioned.robots", "safety.commissioned.wrong_signs", "safety.commissioned.gain_error.worst",
         "safety.commissioned.delay_error.worst"),
    ),
    (
        "Arm of four joints: {} false alarms in {} h.",
        ("safety.arm.long_lives.false_alarms", "safety.arm.long_lives.healthy_hours"),
    ),
    ("Virtual lab, elbow: {} false alarms in {} h.", ("safety.lab.false_alarms", "safety.lab.healthy_hours")),
    (
        "Virtual lab, inaccurate drive measurements: {} false alarms in {} h on the elbow, {} in {} h on the knee.",
        ("safety.drive_reading.elbow.false_alarms", "safety.drive_reading.elbow.healthy_hours",
         "safety.drive_reading.knee.false_alarms", "safety.drive_reading.knee.healthy_hours"),
    ),
    (
        "Worn leg of 44 N·m, default export: {} false alarms in {} h, {} starts refused, drive faults at most {} times "
        "the printed energies.",
        ("safety.leg.unmeasured.false_alarms", "safety.leg.unmeasured.healthy_hours", "safety.leg.starts_refused",
         "safety.leg.unmeasured.energy_over_printed"),
    ),
    ("Random inputs: {} unsafe commands in {} control periods.", ("safety.unsafe", "safety.fuzzed_cycles")),
    ("Heap operations while the controller runs: {}.", ("safety.heap_operations",)),
    ("Time added to one control period on a computer: {} ns.", ("supervisor.step",)),
    (
        "Cortex-M4F: {} instructions a period, {} bytes, {} answers that differ from the computer.",
        ("supervisor.m4.instructions", "supervisor.m4.bytes", "supervisor.m4.wrong"),
    ),
)  # fmt: skip
"""Sentences of the results, and the figures that each states."""

INTRODUCTION = """# Validation of the supervisor

This page is generated from `research/evidence/results/supervisor.json`. [Supervision](../explanation/supervision.md)
explains the checks.

**Claim.** An exported controller stops most single faults of sensor, drive, clock or memory before they transfer more
than a few joules to the wearer. It seldom stops a healthy robot. Exceptions are listed.

**Data.** Simulated. Fifteen controllers of an elbow exoskeleton, as `pellucid export` writes them, run on simulated
plants. The plants share no equation with the core: bristle friction, transmission with backlash, drive with lag and
ripple, hardening straps, muscle servo. Inertia, friction and gravity are 0.7 to 1.4 times the identified values.
Sensors have gain errors of 5 %, offsets of 1 % of the effort limit, lag, noise and quantization. No threshold was
chosen on these plants.

**Baseline.** The same exports with neither a drive measurement nor a probe (`--no-probe --unmeasured`).

**Command.** `python -m research.evidence.safety` measures again and writes this page.
`python -m research.evidence.safety --page` only writes the page.

**Limits.** Real wearers may move, tremble and cramp in other ways. Real machines may have resonances or faults that are
not simulated.
"""
"""Text before the results."""

ROBOTS_TEXT = """## Robots and instruments

*Excess energy* is the positive work of the robot on the limb beyond the same run without the fault. It counts from the
onset until the output is safe, or over 10 s if the fault is not detected. The detection rate counts runs in which a
fault had an effect: it was detected, transferred 0.05 J, or changed the mean effort by 5 % of the limit. A
wearer's own faults, such as a spasm, are excluded here.
"""
"""Text before the table of robots."""

TABLE_TEXT = """## All faults

Each cell gives longest time to detection (ms) and largest excess energy (J), with the detection rate first where it is
below 100 %. A star marks a fault that no sensor of a robot with one encoder can show.
"""
"""Text before the table of faults."""

def claim_lines(results: Results) -> Iterator[str]:
    """Yield the results in sentences; a figure that was not measured has none."""
    for words, names in CLAIMS:
        values = [results.value(name) for name in names]
        if all(value is not None for value in values):
            yield "- " + words.format(*(number(value) for value in values if value is not None))


def validation_page(results: Results) -> str:
    """Return the page of the validation in Markdown."""
    interval = f"Detection rate with its {100.0 * CONFIDENCE:.0f} % confidence interval, and largest excess energy:"
    lines = [INTRODUCTION, "## Results", "", interval, "", *comparison(results), "", *claim_lines(results), ""]
    lines += [ROBOTS_TEXT, *robot_table(results), "", TABLE_TEXT, *fault_table(results)]
    return "\n".join(lines) + "\n"


def summary_table(results: Results) -> Iterator[str]:
    """Yield the lines of the table of faults in the explanation: detection rate, median time, largest energy."""
    # Of a fault with several amplitudes, the largest.
    shown = [{fault.fault: fault for fault in results.of(robot)} for robot in ("drive_measured", "unmeasured")]
    yield "| fault | with a drive measurement | default export |"
    yield "|---|---|---|"
    for name in SUMMARY_FAULTS:
        found = [faults[name] for faults in shown if name in faults]
        if len(found) == len(shown):
            cells = (cell(fault, fault.median) for fault in found)
            yield f"| {happens(found[0])} | {' | '.join(cells)} |"


def with_table(text: str, results: Results) -> str:
    """Return the explanation with a new table between its marks."""
    lines = "\n".join(summary_table(results))
    return re.sub(
        rf"({re.escape(BEGIN_MARK)}).*?({re.escape(END_MARK)})", lambda found: f"{found[1]}\n{lines}\n{found[2]}", text,
        flags=re.DOTALL,
    )  # fmt: skip


def write_pages(results: Results) -> None:
    """Write the validation page, and the table of the explanation."""
    VALIDATION_PAGE.parent.mkdir(exist_ok=True)
    write_text_atomically(VALIDATION_PAGE, validation_page(results))
    write_text_atomically(EXPLANATION_PAGE, with_table(EXPLANATION_PAGE.read_text(encoding="utf-8"), results))
