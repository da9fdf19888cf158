"""Separate recordings that share one table, where each column's name contains its run."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..name_evidence import read_name
from ._columns import Columns

_RUN = (
    r"(?:trial|run|repetition|take|recording|measurement|experiment|versuch|messung|lauf|essai|mesure|ensayo|prova)"
    r"[\s_#-]*\d+"
)
_RUN_LAST = re.compile(rf"(?P<stem>.+?)[\s,;:|_-]+(?P<run>{_RUN})", re.IGNORECASE)
_RUN_FIRST = re.compile(rf"(?P<run>{_RUN})\s*[:|]\s*(?P<stem>.+)", re.IGNORECASE)


def with_own_runs(columns: Columns) -> Columns:
    """Return columns in which each run of a table with several runs is a separate recording.

    Data loggers for teaching export such tables: ``Time (s) Run #1, Angle (rad) Run #1, Time (s) Run #2, ...``, or
    ``Run 1: Time (s)``. All runs have the same columns, with times of their own, and shorter runs end in empty cells.
    """
    if columns.recordings:
        return columns
    found = {name: _run_of(name) for name in columns.values}
    runs: dict[str, dict[str, str]] = {}
    for name, place in found.items():
        if place is None:
            return columns
        runs.setdefault(place[0], {})[place[1]] = name
    stems = {tuple(names) for names in runs.values()}
    if len(runs) < 2 or len(stems) != 1 or sum(map(len, runs.values())) < len(found):
        return columns
    if not any(read_name(stem).quantity == "time" for stem in next(iter(stems))):
        return columns
    values: dict[str, np.ndarray | str] = {}
    units: dict[str | int, str] = {}
    for run, names in runs.items():
        rows = _rows(columns.values, names)
        for stem, name in names.items():
            x = columns.values[name]
            values[f"{run}.{stem}"] = x[:rows] if isinstance(x, np.ndarray) else x
            if name in columns.units:
                units[f"{run}.{stem}"] = columns.units[name]
    return replace(columns, values=values, units=units, recordings=tuple(runs))


def _run_of(name: str) -> tuple[str, str] | None:
    """Return the run of a column as one word, and the rest of its name; None if it names no run."""
    match = _RUN_LAST.fullmatch(name.strip()) or _RUN_FIRST.fullmatch(name.strip())
    return None if match is None else (re.sub(r"[\W_]+", "_", match["run"]).casefold(), match["stem"].strip())


def _rows(values: Mapping[str, np.ndarray | str], names: Mapping[str, str]) -> int:
    """Return the number of rows of a run up to its last number."""
    known = [np.flatnonzero(np.isfinite(x)) for name in names.values() if isinstance(x := values[name], np.ndarray)]
    return max((int(rows[-1]) + 1 for rows in known if rows.size), default=0)
