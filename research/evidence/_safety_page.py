"""docs/safety.md: the table of single faults as the proof measured it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pellucid._atomic import write_text_atomically
from pellucid.study.results import ResultRow
from pellucid_lab.safety.fault_table import FAULT_KINDS, FaultKind, FaultTable, FaultTrial

PAGE_FILE = Path(__file__).parents[2] / "docs" / "safety.md"
"""File of the page that holds the measured tables."""

TABLE_HEAD = ("fault", "what happens", "found", "median", "latest", "safe by", "excess", "peak")
"""Titles of the columns of a table of faults."""

BEGIN_MARK = "<!-- measured -->"
"""Comment before the measured part of the page."""

END_MARK = "<!-- end of measured -->"
"""Comment after the measured part of the page."""


def line(kind: FaultKind, trials: Sequence[FaultTrial]) -> tuple[str, ...]:
    """A fault's row: shares, times [ms], energy [J], torque [N m]."""
    found = [1e3 * t.found for t in trials if t.found == t.found]
    safe = [1e3 * t.safe for t in trials if t.safe == t.safe]

    def ms(x: float) -> str:
        return f"{x:.0f} ms"

    return (
        f"`{kind.name}`{' *' if kind.hidden else ''}",
        kind.sentence,
        f"{len(found)} of {len(trials)}",
        ms(float(np.median(found))) if found else "",
        ms(max(found)) if found else "",
        ms(max(safe)) if safe else "",
        f"{max(t.excess for t in trials):.2f} J",
        f"{max(t.peak for t in trials):.1f} N m",
    )


def table(measured: FaultTable, level: str = "###") -> str:
    """The table of all faults, in Markdown."""
    text = []
    for group in dict.fromkeys(kind.group for kind in FAULT_KINDS):
        text.append(f"{level} {group.capitalize()}\n")
        text.append(f"| {' | '.join(TABLE_HEAD)} |\n|{'---|' * 2}{'--:|' * 6}")
        for kind in FAULT_KINDS:
            trials = measured.trials_of(kind.name)
            if kind.group == group and trials:
                text.append(f"| {' | '.join(line(kind, trials))} |")
        text.append("")
    return "\n".join(text)


KNEE_SECTION_TEXT = """### A worn knee

The residual compensator of a series-elastic orthosis has a table of its own. Its effort is what a spring is asked
for; the spring's own torque loop is off by as much as faults would be (up to 4 N m, motor friction), its wearers give
it as much, and the wave of a test at start-up would meet that loop. So no model is held against the wearer; a drive
is found by the energy that it adds. Faults that need a force sensor, a start-up test, a table or an open strap are
not here. Twenty drawn wearers swing; limb, strap, actuator and EMG are known with the errors of an identification,
and the law, with EMG and without, is the one that `export` writes. Its EMG is their torque, off by a factor, not a
recording's.
"""
"""Text of the section on a worn knee, before its table."""


EXPORTED_SECTION_TEXT = """### Exported controllers

What `pellucid export` writes, compiled and worn on foreign plants: other equations of friction, transmission, drive
and straps than the core's, inertia, friction and gravity 0.7 to 1.4 times the card's, wearers' stiffness from 6 to
120 N m/rad, and instruments with a gain wrong by 5 %, an offset of 1 % of the limit, a lag of 0.3 to 2 ms, noise and a
quantum (`research/evidence/_exported`). A fault did something where it was found, gave 0.05 J or more, or changed the
drive's mean effort by 5 % of its limit.
"""
"""Text of the section on exported controllers, before its tables."""

LAB_SECTION_TEXT = """### The same laws in the virtual lab

Plant and model share their kinds of equations here, not their numbers. The drive is measured exactly.
"""
"""Text of the section on the lab's robots, before their tables."""

MAX_SHOWN_PARTS = 4
"""Figures of exported controllers whose names have more parts are those of single faults, which have a table."""


def write_page(
    measured: FaultTable,
    worn: FaultTable,
    rows: Sequence[ResultRow],
    exported: Sequence[str] = (),
    arms: Sequence[str] = (),
) -> None:
    """Put what was measured between the page's two marks: tables of exported controllers, arms, robots and knees."""
    listed = [r for r in rows if not (r.id.startswith("safety.exported.") and r.id.count(".") >= MAX_SHOWN_PARTS)]
    said = "\n".join(
        f"| `{r.id}` | {'none' if r.value is None else f'{r.value:.4g}'} {r.unit.removeprefix('1')} | {r.note} |"
        for r in listed
    )
    text = PAGE_FILE.read_text(encoding="utf-8")
    before, after = text.split(BEGIN_MARK)[0], text.split(END_MARK)[1]
    figures = f"### Figures\n\n| figure | value | |\n|---|--:|---|\n{said}\n"
    parts = [
        EXPORTED_SECTION_TEXT,
        "\n".join(exported),
        "### Arms of several joints\n",
        "\n".join(arms),
        "",
        LAB_SECTION_TEXT,
        table(measured),
        KNEE_SECTION_TEXT,
        table(worn, "####"),
    ]
    body = "\n".join(parts)
    write_text_atomically(PAGE_FILE, f"{before}{BEGIN_MARK}\n\n{body}\n{figures}\n{END_MARK}{after}")
