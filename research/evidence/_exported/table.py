"""Tables of what faults of exported controllers came to, for docs/safety.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pellucid_lab.safety.fault_table import FaultKind

from .trials import KINDS, ForeignTrial

TABLE_HEAD = ("fault", "what happens", "instruments", "found", "of those that did something", "median", "latest",
              "safe by", "excess", "peak")  # fmt: skip
"""Titles of the columns of a table of faults."""

INSTRUMENT_WORDS = {
    "unmeasured": "encoder alone, as exported by default: with a probe, commissioned",
    "drive_measured": "encoder, drive's current, commissioned test",
    "blind": "encoder alone: neither probe nor watch for shaking",
    "drive_measured_and_probe": "encoder, drive's current, commissioned test and probe",
    "knee-orthosis": "the knee orthosis with a spring, as exported by default",
}
"""What a row assumes, in words, by the name of the set of instruments."""


def line(kind: FaultKind, instruments: str, trials: Sequence[ForeignTrial]) -> tuple[str, ...]:
    """Return a fault's row: shares, times [ms], energy [J], torque [N m]."""
    found = [1e3 * trial.found for trial in trials if trial.is_found]
    safe = [1e3 * trial.safe for trial in trials if trial.safe == trial.safe]
    effective = [trial for trial in trials if trial.did_something]

    def ms(value: float) -> str:
        return f"{value:.0f} ms"

    return (
        f"`{kind.name}`{' *' if kind.hidden else ''}",
        kind.sentence,
        INSTRUMENT_WORDS[instruments] + ("; force sensor" if kind.needs == "interaction" else "")
        + ("; EMG" if kind.needs == "muscle" else ""),
        f"{len(found)} of {len(trials)}",
        f"{len(found)} of {len(effective)}",
        ms(float(np.median(found))) if found else "",
        ms(max(found)) if found else "",
        ms(max(safe)) if safe else "",
        f"{max(trial.excess for trial in trials):.2f} J",
        f"{max(trial.peak for trial in trials):.1f} N m",
    )  # fmt: skip


def table_lines(measured: dict[str, Sequence[ForeignTrial]], level: str = "####") -> Iterator[str]:
    """Yield the Markdown lines of all faults, by sets of instruments and groups of faults."""
    for instruments, trials in measured.items():
        valid = [trial for trial in trials if not trial.early]
        for group in dict.fromkeys(kind.group for kind in KINDS.values()):
            rows = [
                line(kind, instruments, own)
                for kind in KINDS.values()
                if kind.group == group and (own := [trial for trial in valid if trial.kind == kind.name])
            ]
            if not rows:
                continue
            yield f"{level} {group.capitalize()}: {INSTRUMENT_WORDS[instruments]}"
            yield ""
            yield f"| {' | '.join(TABLE_HEAD)} |"
            yield f"|{'---|' * 3}{'--:|' * 7}"
            for row in rows:
                yield f"| {' | '.join(row)} |"
            yield ""
