"""A walking wearer under transparency laws: a thigh that moves, ground under the foot, three speeds.

Strides are recorded (3.6 and 8.1 km/h of one person; 5.4 km/h is the slower recording played 1.5 times as fast), people
and orthoses drawn with seeds on which nothing was chosen. Every wearer is identified as in the paper, sitting with the
thigh at rest, and every law is built from these cards alone. The plant has what no law knows: a thigh that turns and
accelerates, a foot that the ground pushes and holds, an elastic drive with its torque loop, friction, a strap that
hardens, relaxes and slips, muscles that tire. It shares with the laws that bodies are rigid.

The sessions are those of `pellucid reproduce knee` (`pellucid_lab.papers.knee.walking`); the rows here have
intervals over wearers, and wearers of two further seeds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pellucid.study.results import ResultRow
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.papers.knee.walking import (
    EXTENDED_LAWS,
    FREE_FOOT,
    LAW_WORDS,
    SITTING_CONDITION,
    WALKING_DURATION_S,
    WALKING_SPEEDS,
    WalkedRow,
    evaluate_walker,
    source_of_strides,
    walked,
)
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

from ._loads import mean_interval, ratio_interval

SEED = 8300
"""First seed of the simulated wearers; constants were chosen on wearers 101 to 106."""

FURTHER_SEEDS = sized((8310, 8320), smallest=())
"""First seeds of further wearers, of whom the laws of `FURTHER_LAWS` alone are worn."""

FURTHER_LAWS = ("zero_impedance", "body", "residual_no_emg", "residual", "residual_walking_gate")
"""Laws that wearers of further seeds wear."""

WEARER_COUNT = sized(3, smallest=1)
"""Number of wearers of each seed, each with an orthosis of their own."""

DURATION_S = sized(WALKING_DURATION_S, smallest=6.0)
"""Duration of every session [s]."""


def walking_rows(count: int = WEARER_COUNT) -> Iterator[ResultRow]:
    """Every figure of walking wearers."""
    found = walk(SEED, count, tuple(LAW_WORDS))
    yield _row("speeds", len(WALKING_SPEEDS), "1", f"{', '.join(WALKING_SPEEDS)} km/h; {source_of_strides()}")
    yield _row("laws", len(LAW_WORDS), "1", ", ".join(LAW_WORDS))
    for speed in (SITTING_CONDITION, *WALKING_SPEEDS):
        base = torques(found, "zero_impedance", speed)
        low, high = mean_interval(base, SEED)
        note = f"RMS strap torque without control, {speed}; {count} wearers, 95 % interval {low:.2f} to {high:.2f}"
        yield _row(f"{speed}.zero_impedance", base.mean(), "N*m", note)
        for name in LAW_WORDS:
            if name != "zero_impedance" and not (speed == SITTING_CONDITION and name in EXTENDED_LAWS):
                own = torques(found, name, speed)
                yield _ratio(f"{speed}.{name}", own, base, f"{name} over zero impedance, {speed}")
    for speed in WALKING_SPEEDS:
        stance, swing = (torques(found, "residual", speed, part) for part in ("stance", "swing"))
        yield _ratio(f"{speed}.stance_over_swing", stance, swing, "residual law, RMS in stance over that in swing")
        own = torques(found, "residual", speed)
        plain = torques(found, "residual_no_emg", speed)
        yield _ratio(f"{speed}.emg", own, plain, "residual law over the same without EMG")
        for name in ("zero_impedance", "residual", "residual_thigh_sensor"):
            error = np.degrees(torques(found, name, speed, "error").mean())
            yield _row(f"{speed}.{name}.error", error, "deg", "RMS of knee from what was meant")
    free = torques(found, "residual", FREE_FOOT)
    residual = torques(found, "residual", "3.6")
    yield _ratio("free_foot", free, residual, "residual law at 3.6 km/h, ground that holds no foot")
    for speed in WALKING_SPEEDS:
        for name in LAW_WORDS:
            if name != "zero_impedance":
                faults = [row.fault for row in walked(found, name, speed) if row.fault != "none"]
                note = f"sessions of {count} that the law's gate stopped" + (f": {', '.join(faults)}" if faults else "")
                yield _row(f"{speed}.{name}.stopped", len(faults), "1", note)
    walks = [row for row in found if row.condition != SITTING_CONDITION]
    stopped = sum(row.fault != "none" for row in walks)
    yield _row("stopped", stopped, "1", f"sessions of {len(walks)} that a gate stopped")
    yield from further_rows(found, count)


def further_rows(first: Sequence[WalkedRow], count: int) -> Iterator[ResultRow]:
    """Return each ratio again over wearers of every seed, with its range over seeds."""
    if not FURTHER_SEEDS:
        return
    groups = [first, *(walk(seed, count, FURTHER_LAWS) for seed in FURTHER_SEEDS)]
    everybody = [row for group in groups for row in group]
    for speed in (SITTING_CONDITION, *WALKING_SPEEDS):
        for name in FURTHER_LAWS[1:]:
            if speed == SITTING_CONDITION and name in EXTENDED_LAWS:
                continue
            by_seed = [
                torques(group, name, speed).mean() / torques(group, "zero_impedance", speed).mean() for group in groups
            ]
            own, base = torques(everybody, name, speed), torques(everybody, "zero_impedance", speed)
            stopped = sum(row.fault != "none" for row in walked(everybody, name, speed))
            words = (
                f"{name} over zero impedance, {speed}, seeds {SEED}, {', '.join(map(str, FURTHER_SEEDS))}: "
                f"{', '.join(f'{x:.2f}' for x in by_seed)}; stopped {stopped}"
            )
            yield _ratio(f"{speed}.{name}.seeds", own, base, words)


def walk(seed: int, count: int, laws: tuple[str, ...]) -> list[WalkedRow]:
    """Return what some laws leave of the walks of wearers who are drawn with a seed and those after it."""
    jobs = [(_walk_one, f"D{seed + i}", laws) for i in range(count)]
    return [row for rows in ordered_results(jobs) for row in rows]


def _walk_one(name: str, laws: tuple[str, ...]) -> tuple[WalkedRow, ...]:
    return evaluate_walker(knee_orthosis(), name, laws=laws, duration=DURATION_S)


def torques(rows: Sequence[WalkedRow], law: str, condition: str, what: str = "torque") -> np.ndarray:
    """Return a field of the rows of one law in one condition, by wearer, (n,)."""
    return np.array([getattr(row, what) for row in walked(rows, law, condition)])


def _ratio(name: str, over: np.ndarray, under: np.ndarray, words: str) -> ResultRow:
    ratio, low, high = ratio_interval(over, under)
    note = f"{words}; {len(over)} wearers, 95 % interval {low:.3f} to {high:.3f}; {over.mean():.3f} N*m"
    return _row(name, ratio, "1", note)


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"mission.walking.{name}", float(value), unit, "evidence", "simulated", None, note)
