"""Find the column that is time among columns of numbers, and its unit by its increments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .name_evidence import NameEvidence

UNIT_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
"""Units of time columns, in seconds."""

USUAL_RATES_HZ = (5.0, 5000.0)
"""Range of sampling rates that loggers of joints and muscles have. A unit that gives a rate in it is likely [Hz]."""

POSSIBLE_RATES_HZ = (0.5, 60000.0)
"""Range of sampling rates that are possible [Hz]."""

EPOCH_RANGE_S = (3.0e8, 3.0e9)
"""Seconds since 1970 between 1979 and 2065. A column within this range is a wall clock, and its unit is certain."""

MIN_RISING_SHARE = 0.97
"""Time may stand still or fall in at most the remaining share of steps, as stale packets and restarts make it do."""

MAX_REPEATED_SHARE = 0.5
"""A clock that stands still in more than this share of steps is coarser than the samples: only its mean rate is
used."""


MIN_UNNAMED_SCORE = 0.7
"""A column whose name says no time has to advance so evenly: a slow movement also rises throughout."""


@dataclass(frozen=True)
class FoundClock:
    """The time of a table's rows."""

    column: str | None  # name of the column; None if there is none or if only its mean rate is used
    unit: str  # unit of the column
    rate: float | None  # sampling rate by the column [Hz]; None if it is not known
    why: str  # reason, for a comment in study.toml
    is_certain: bool  # whether the unit follows from the column or its name, and not from what is usual
    coarse_column: str | None = None  # column that is a clock, but stands still for several samples
    others: tuple[str, ...] = ()  # further columns that advance like a clock
    first_sound: int = 0  # index of the first row after which the clock advances without falling back


def find_clock(columns: Mapping[str, np.ndarray], names: Sequence[NameEvidence]) -> FoundClock:
    """Return the clock among columns of one length, shape (n,) each.

    A clock advances in nearly all steps and by nearly equal ones. Its unit is that of its name. Without one it follows
    from the years since 1970, or from the sampling rate, which is usually 5 to 5000 Hz.
    """
    candidates = []
    for evidence in names:
        values = columns[evidence.name]
        score = _clock_score(values)
        by_name = evidence.quantity == "time"
        if score is None or (evidence.quantity not in (None, "time", "counter") and not by_name):
            continue
        if not by_name and score < MIN_UNNAMED_SCORE:
            continue
        is_counter = _counts_rows(values) and not by_name
        candidates.append((by_name, not is_counter, score, evidence))
    candidates = [c for c in candidates if c[0] or c[1]]
    if not candidates:
        return FoundClock(None, "s", None, "no column advances like a clock", False)
    _, _, score, best = max(candidates, key=lambda c: (c[0], c[1], c[2]))
    others = tuple(c[3].name for c in candidates if c[3] is not best)
    return _clock_of(columns[best.name], best, others)


def _clock_of(values: np.ndarray, evidence: NameEvidence, others: tuple[str, ...]) -> FoundClock:
    known = values[np.isfinite(values)]
    first = _first_sound_row(values)
    steps = np.diff(known[first:] if np.isfinite(values).all() else known)
    positive = steps[steps > 0.0]
    repeated = float(np.mean(steps == 0.0))
    unit, why, certain = _unit(known[len(known) // 2], float(np.median(positive)), evidence)
    span = (known[-1] - known[first if first < len(known) else 0]) * UNIT_SECONDS[unit]
    if repeated > MAX_REPEATED_SHARE:
        advances = np.flatnonzero(np.diff(known) > 0.0)
        whole = (known[advances[-1] + 1] - known[advances[0] + 1]) * UNIT_SECONDS[unit]
        # Between its first and its last advance a coarse clock shows whole steps.
        rate = float((advances[-1] - advances[0]) / whole) if whole > 0.0 else len(steps) / span if span > 0.0 else None
        return FoundClock(
            None,
            "s",
            rate,
            f'"{evidence.name}" stands still in {100 * repeated:.0f} % of the steps: it is coarser than the samples, '
            "so that their mean rate takes its place",
            False,
            coarse_column=evidence.name,
            others=others,
        )
    inner = positive[positive < 1.5 * np.median(positive)]
    step = float(np.mean(inner)) if len(inner) else float(np.median(positive))
    return FoundClock(evidence.name, unit, 1.0 / (step * UNIT_SECONDS[unit]), why, certain, None, others, first)


def _clock_score(values: np.ndarray) -> float | None:
    """Return how evenly a column advances, in (0, 1]; None if it does not advance like a clock."""
    known = values[np.isfinite(values)]
    if len(known) < 8 or len(known) < 0.9 * len(values):
        return None
    steps = np.diff(known)
    rising, standing = np.mean(steps > 0.0), np.mean(steps == 0.0)
    if rising == 0.0 or rising + standing < MIN_RISING_SHARE:
        return None
    positive = steps[steps > 0.0]
    median = np.median(positive)
    if standing > MAX_REPEATED_SHARE:
        # A coarse clock has equal steps wherever it advances.
        even = np.mean(np.abs(positive - median) <= 0.5 * median)
        return 0.3 * float(even) if even > 0.5 and len(positive) >= 2 else None
    near = np.mean((positive > 0.2 * median) & (positive < 5.0 * median))
    # A column that rises by chance, such as a slow ramp, has steps of very different sizes.
    if near < 0.8:
        return None
    spread = float(np.mean(np.abs(positive - median)) / median)
    return float(near) / (1.0 + spread)


def _counts_rows(values: np.ndarray) -> bool:
    """Whether a column is the number of its row: whole numbers in steps of exactly 1 from 0 or 1."""
    return bool(values[0] in (0.0, 1.0) and np.all(np.diff(values) == 1.0))


def _first_sound_row(values: np.ndarray) -> int:
    """Return the index after the last fall of time within the first tenth; stale packets stand at the beginning."""
    head = np.diff(values[: max(10, len(values) // 10)])
    with np.errstate(invalid="ignore"):
        falls = np.flatnonzero(head < 0.0)
    return int(falls[-1]) + 1 if falls.size else 0


def _unit(middle: float, step: float, evidence: NameEvidence) -> tuple[str, str, bool]:
    if evidence.quantity == "time" and evidence.unit in UNIT_SECONDS:
        rate = 1.0 / (step * UNIT_SECONDS[evidence.unit])
        if POSSIBLE_RATES_HZ[0] / 50.0 <= rate <= 10.0 * POSSIBLE_RATES_HZ[1]:
            return evidence.unit, f"the header says {evidence.unit}; steps of {step:.4g} give {rate:.4g} Hz", True
    for unit, seconds in UNIT_SECONDS.items():
        is_wall_clock = EPOCH_RANGE_S[0] <= middle * seconds <= EPOCH_RANGE_S[1] and unit != "min"
        if is_wall_clock and (unit == "s" or _is_usual(1.0 / (step * seconds))):
            return unit, f"the numbers are {unit} since 1970, in steps of {step:.4g}", True
    usual = [u for u in ("s", "ms", "us", "ns") if _is_usual(1.0 / (step * UNIT_SECONDS[u]))]
    possible = [
        u for u in ("s", "ms", "us", "ns")
        if POSSIBLE_RATES_HZ[0] <= 1.0 / (step * UNIT_SECONDS[u]) <= POSSIBLE_RATES_HZ[1]
    ]  # fmt: skip
    unit = (usual or possible or ["s"])[0]
    rate = 1.0 / (step * UNIT_SECONDS[unit])
    why = f"steps of {step:.4g} are {rate:.4g} Hz in {unit}"
    if len(usual) == 1:
        return unit, why, True
    rest = " or ".join(u for u in (usual or possible) if u != unit)
    return unit, f"{why}, which {rest or 'nothing'} would make unusual", False


def _is_usual(rate: float) -> bool:
    return USUAL_RATES_HZ[0] <= rate <= USUAL_RATES_HZ[1]
