"""Part the rows of publishers that share a table with one column of times and leave the others' cells empty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..name_evidence import read_name
from ._columns import Columns

MIN_ROWS = 50
"""A publisher has at least so many rows."""

MIN_COVERED_SHARE = 0.98
"""At least this share of the rows has a value of some publisher."""

MAX_SHARED_SHARE = 0.3
"""Two publishers have at most this share of the smaller one's rows in common: messages with the same stamp."""

MAX_PUBLISHERS = 8
"""Largest number of distinguished publishers; more patterns of empty cells have another cause."""

MIN_SLOWER_ROWS = 2
"""A slower sensor has a value in at most every second row."""

MIN_EVEN_SHARE = 0.95
"""Smallest share of a slower sensor's steps that are equally many rows but one: losses come at random."""


def with_own_rows(columns: Columns) -> Columns:
    """Return columns in which each publisher has its own rows, and the times of these.

    PlotJuggler exports all topics into one table: a row has the values of one topic, and empty cells for the others.
    The publisher with the most rows keeps the name of the times; the others have it with a number behind.
    """
    numbers = {n: x for n, x in columns.values.items() if isinstance(x, np.ndarray) and len(x) >= MIN_ROWS}
    if len({len(x) for x in numbers.values()}) != 1:
        return columns
    known = {name: np.isfinite(x) for name, x in numbers.items()}
    if all(mask.all() for mask in known.values()):
        return columns
    clock = next((n for n, x in numbers.items() if read_name(n).quantity == "time" and known[n].all()), None)
    groups = _groups({name: mask for name, mask in known.items() if name != clock and not mask.all()})
    whole = [name for name, mask in known.items() if name != clock and mask.all()]
    if clock is None:
        return columns
    if whole or not _are_publishers([mask for mask, _ in groups]):
        groups = [(mask, names) for mask, names in groups if _is_slower(mask)]
        return _with_slower_streams(columns, clock, groups) if groups else columns
    groups.sort(key=lambda group: -int(group[0].sum()))
    rows = {name: mask for mask, names in groups for name in names}
    times = {names[0]: clock if k == 0 else f"{clock} {k + 1}" for k, (_, names) in enumerate(groups)}
    values: dict[str, np.ndarray | str] = {}
    units = dict(columns.units)
    for name, x in columns.values.items():
        if name == clock:
            continue
        if name in times:
            values[times[name]] = numbers[clock][rows[name]]
            if clock in columns.units:
                units[times[name]] = columns.units[clock]
        values[name] = numbers[name][rows[name]] if name in rows else x
    return replace(columns, values=values, units=units)


def _with_slower_streams(columns: Columns, clock: str, groups: Sequence[tuple[np.ndarray, list[str]]]) -> Columns:
    """Return columns in which those that are known in every k-th row alone have rows and times of their own."""
    values, units = dict(columns.values), dict(columns.units)
    for k, (mask, names) in enumerate(groups, 2):
        time = f"{clock} {k}"
        slower: dict[str, np.ndarray | str] = {time: np.asarray(values[clock])[mask]}
        slower |= {name: np.asarray(values.pop(name))[mask] for name in names}
        values |= slower
        if clock in units:
            units[time] = units[clock]
    return replace(columns, values=values, units=units)


def _is_slower(known: np.ndarray) -> bool:
    """Whether the known rows are every k-th one, as a slower sensor leaves them in the table of a faster one."""
    steps = np.diff(np.flatnonzero(known))
    if len(steps) < MIN_ROWS or np.median(steps) < MIN_SLOWER_ROWS:
        return False
    return bool(np.mean(np.abs(steps - np.median(steps)) <= 1.0) >= MIN_EVEN_SHARE)


def _groups(known: Mapping[str, np.ndarray]) -> list[tuple[np.ndarray, list[str]]]:
    """Return the columns whose cells are filled in the same rows, but for a few, with these rows."""
    groups: list[tuple[np.ndarray, list[str]]] = []
    for name, mask in known.items():
        count = int(mask.sum())
        for i, (other, names) in enumerate(groups):
            if np.sum(mask != other) <= 0.02 * max(count, int(other.sum()), 1):
                groups[i] = other | mask, [*names, name]
                break
        else:
            if count:
                groups.append((mask, [name]))
        if len(groups) > MAX_PUBLISHERS:
            break
    return groups


def _are_publishers(masks: list[np.ndarray]) -> bool:
    """Whether rows belong to one publisher each: few have values of two, and hardly any of none."""
    if not 2 <= len(masks) <= MAX_PUBLISHERS or max(int(mask.sum()) for mask in masks) < MIN_ROWS:
        return False
    if np.mean(np.any(masks, axis=0)) < MIN_COVERED_SHARE:
        return False
    for i, mask in enumerate(masks):
        for other in masks[i + 1 :]:
            smaller = min(int(mask.sum()), int(other.sum()))
            if np.sum(mask & other) > MAX_SHARED_SHARE * smaller:
                return False
    return True
