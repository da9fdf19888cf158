"""Recordings as arrays: one or several, and those that are held out.

A recording is a table with the columns ``time``, ``position``, ``effort`` and optionally ``velocity``. A table is a
mapping, a data frame or a structured array.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..._errors import ArgumentError, IdentificationError, RecordingError
from ...numerics.arguments import held_out_names, held_out_share, is_table, real_column, shown, table_columns

REQUIRED_COLUMNS = ("time", "position", "effort")
"""Columns that every recording has."""

OPTIONAL_COLUMNS = ("velocity",)
"""Columns that a recording may have."""

EXPECTED_RECORDINGS = "arrays time, position and effort, or tables with these columns"
"""What a function of recordings takes, for messages."""


@dataclass(frozen=True)
class ArrayRecording:
    """The columns of one recording by their names, each (n,), and whether it is held out."""

    name: str
    columns: Mapping[str, np.ndarray]
    is_held_out: bool = False

    def part(self, name: str, rows: slice, is_held_out: bool) -> ArrayRecording:
        """Return some of the rows as a recording."""
        return ArrayRecording(name, {n: x[rows] for n, x in self.columns.items()}, is_held_out)

    @property
    def rate(self) -> float:
        """Sampling rate, one over the usual time step [Hz]; NaN if time does not increase."""
        steps = np.diff(self.columns["time"])
        steps = steps[np.isfinite(steps) & (steps > 0.0)]
        if not steps.size:
            return float("nan")
        step = float(np.median(steps))
        # The mean of even steps is finer than the median, which ends at the last digit of the clock.
        even = steps[steps < 1.5 * step]
        return 1.0 / float(np.mean(even))


def collect_recordings(
    where: str,
    time: Any,
    position: Any = None,
    effort: Any = None,
    velocity: Any = None,
    *,
    units: Mapping[str, str],
    stem: str = "recording",
) -> list[ArrayRecording]:
    """Return the recordings that arrays or tables hold. `units` has the SI unit of each column, `stem` begins names."""
    if position is None and effort is None:
        if velocity is not None:
            raise ArgumentError(f"{where}: position: found None, expected {EXPECTED_RECORDINGS}")
        tables = _named_tables(where, time, stem)
    else:
        given = dict(zip((*REQUIRED_COLUMNS, *OPTIONAL_COLUMNS), (time, position, effort, velocity), strict=True))
        for name in REQUIRED_COLUMNS:
            if given[name] is None:
                raise ArgumentError(f"{where}: {name}: found None, expected an array of real numbers")
        tables = _tables_of_columns(where, {n: x for n, x in given.items() if x is not None}, stem)
    if not tables:
        raise IdentificationError(f"{where}: found no recording, expected one or more")
    several = len(tables) > 1 or stem != "recording"
    made = []
    for name, table in tables.items():
        present = table_columns(table)
        missing = [column for column in REQUIRED_COLUMNS if column not in present]
        if missing:
            raise RecordingError(
                f"{where}: {name}: found the columns {', '.join(present) or 'none'}, expected {', '.join(missing)} too"
            )
        place = f"{where}: {name}" if several else where
        used = [column for column in (*REQUIRED_COLUMNS, *OPTIONAL_COLUMNS) if column in present]
        columns = {n: real_column(place, n, table[n], unit=units.get(n, "")) for n in used}
        n = len(columns["time"])
        for column, samples in columns.items():
            if len(samples) != n:
                raise RecordingError(f"{place}: {column}: found {len(samples)} samples, expected {n}, as many as times")
        made.append(ArrayRecording(name, columns))
    return made


def _named_tables(where: str, given: Any, stem: str) -> dict[str, Any]:
    """Return tables by the names of their recordings."""
    if isinstance(given, Mapping) and given and all(map(is_table, given.values())):
        return {str(name): table for name, table in given.items()}
    if is_table(given):
        return {f"{stem}_1": given}
    if isinstance(given, (list, tuple)) and all(map(is_table, given)):
        names = [_name_of(table, f"{stem}_{i}") for i, table in enumerate(given, 1)]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise IdentificationError(f"{where}: found the name {twice!r} twice, expected each recording's own")
        return dict(zip(names, given, strict=True))
    raise ArgumentError(f"{where}: time: found {shown(given)}, expected {EXPECTED_RECORDINGS}")


def _name_of(table: Any, default: str) -> str:
    name = table.get("name") if isinstance(table, Mapping) else None
    return name if isinstance(name, str) else default


def _tables_of_columns(where: str, given: Mapping[str, Any], stem: str) -> dict[str, Mapping[str, Any]]:
    """Return tables by name, from a column or a sequence of columns for each quantity."""
    several = [name for name, each in given.items() if _is_several(each)]
    if not several:
        return {f"{stem}_1": given}
    single = [name for name in given if name not in several]
    if single:
        raise ArgumentError(
            f"{where}: {single[0]}: found one array, expected a sequence of arrays as in {several[0]}: one of each "
            "recording"
        )
    counts = {name: len(each) for name, each in given.items()}
    if len(set(counts.values())) > 1:
        text = ", ".join(f"{count} of {name}" for name, count in counts.items())
        raise RecordingError(f"{where}: found arrays of {text}, expected one of each in every recording")
    return {f"{stem}_{i + 1}": {name: each[i] for name, each in given.items()} for i in range(counts["time"])}


def _is_several(values: Any) -> bool:
    """Return whether a value is a sequence of arrays; rows of one number are a single column."""
    if not isinstance(values, (list, tuple)) or not values:
        return False
    return all(_has_samples(x) and len(x) > 1 for x in values)


def _has_samples(values: Any) -> bool:
    """Return whether a value is an array or a sequence, and no text."""
    return hasattr(values, "__len__") and not isinstance(values, (str, bytes)) and getattr(values, "ndim", 1) > 0


def hold_out(where: str, given: list[ArrayRecording], held_out: Any, units: Mapping[str, str]) -> list[ArrayRecording]:
    """Return recordings of which some are held out, or with further ones that are; see `fit_joint`."""
    if held_out is None:
        return given
    if is_table(held_out) or _is_sequence_of(held_out, is_table):
        return [*given, *_held(collect_recordings(where, held_out, units=units, stem="held_out"))]
    if isinstance(held_out, tuple) and len(held_out) in (3, 4) and all(map(_has_samples, held_out)):
        return [*given, *_held(collect_recordings(where, *held_out, units=units, stem="held_out"))]
    share = held_out_share(where, held_out)
    if share is not None and len(given) == 1:
        return _split(given[0], share)
    judged = held_out_names(where, [each.name for each in given], held_out)
    return [replace(each, is_held_out=each.name in judged) for each in given]


def _is_sequence_of(value: Any, is_one: Any) -> bool:
    return (
        isinstance(value, Sequence) and not isinstance(value, (str, bytes)) and bool(value) and all(map(is_one, value))
    )


def _held(recordings: list[ArrayRecording]) -> list[ArrayRecording]:
    return [replace(each, is_held_out=True) for each in recordings]


def _split(one: ArrayRecording, share: float) -> list[ArrayRecording]:
    """Return the first samples of a recording, which are fitted, and the last `share` of them."""
    n = len(one.columns["time"])
    first = n - round(share * n)
    return [one.part("fitted", slice(0, first), False), one.part("held_out", slice(first, n), True)]
