"""Join time stamps that a table holds in two columns, whole seconds and the rest, as ROS and timeval have them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from ._columns import Columns

JOINED_NAME = "stamp"
"""Name of a stamp whose parts have no name in common."""

MIN_ADVANCING_SHARE = 0.9
"""Two columns are the parts of one stamp if their sum does not fall in at least this share of the rows."""

_NAME_OF_SECONDS = re.compile(r"(.*?)[\W_]*(?:secs?|seconds?|s)[\])]?", re.IGNORECASE | re.DOTALL)
_NAME_OF_REST = re.compile(
    r"(.*?)[\W_]*(nanosec(?:ond)?s?|nano|nsecs?|ns|microsec(?:ond)?s?|usecs?|us|millisec(?:ond)?s?|msecs?|ms)[\])]?",
    re.IGNORECASE | re.DOTALL,
)
_TICKS_PER_S = {"n": 1e9, "u": 1e6, "micro": 1e6, "m": 1e3}
"""Ticks of a second by the beginning of the unit's name."""


def with_whole_stamps(columns: Columns) -> Columns:
    """Return columns in which each pair of seconds and nanoseconds is one column of seconds, at the place of the first.

    A pair is recognised by its names, such as ``header.stamp.secs`` and ``header.stamp.nsecs``, and by its numbers:
    whole seconds, a rest below one second, and a sum that advances.
    """
    joined: dict[str, tuple[str, np.ndarray]] = {}
    parts: set[str] = set()
    for seconds, rest, ticks in _pairs(columns.values):
        match = _NAME_OF_SECONDS.fullmatch(seconds)
        name = (match[1] if match else "").rstrip("._/ ") or JOINED_NAME
        if name not in columns.values and not {seconds, rest} & parts:
            joined[seconds] = name, np.asarray(columns.values[seconds]) + np.asarray(columns.values[rest]) / ticks
            parts |= {seconds, rest}
    if not joined:
        return columns
    values: dict[str, np.ndarray | str] = {}
    for name, x in columns.values.items():
        if name in joined:
            values[joined[name][0]] = joined[name][1]
        elif name not in parts:
            values[name] = x
    units = {name: unit for name, unit in columns.units.items() if name not in parts}
    return replace(columns, values=values, units=units | {name: "s" for name, _ in joined.values()})


def _pairs(values: Mapping[str, np.ndarray | str]) -> Iterator[tuple[str, str, float]]:
    """Yield the names of seconds and rest, and the ticks of the rest in a second."""
    rests: dict[str, list[tuple[str, float]]] = {}
    for name in values:
        match = _NAME_OF_REST.fullmatch(name)
        if match is not None:
            kind = match[2].casefold()
            ticks = _TICKS_PER_S.get(kind[:5]) or _TICKS_PER_S[kind[0]]
            rests.setdefault(_folded(match[1]), []).append((name, ticks))
    for name in values if rests else ():
        match = _NAME_OF_SECONDS.fullmatch(name)
        for rest, ticks in rests.get(_folded(match[1]), ()) if match is not None else ():
            if rest != name and _is_stamp(values[name], values[rest], ticks):
                yield name, rest, ticks
                break


def _folded(stem: str) -> str:
    return stem.casefold().rstrip("._/ [(")


def _is_stamp(seconds: np.ndarray | str, rest: np.ndarray | str, ticks: float) -> bool:
    if isinstance(seconds, str) or isinstance(rest, str) or len(seconds) != len(rest) or len(seconds) < 2:
        return False
    known = np.isfinite(seconds) & np.isfinite(rest)
    s, r = seconds[known], rest[known]
    if len(s) < 2 or np.any(s != np.round(s)) or np.any(r != np.round(r)) or r.min() < 0.0 or r.max() >= ticks:
        return False
    total = (s - s[0]) + r / ticks
    # Two clocks in different units would have the seconds of one in the rest of the other.
    return bool(np.mean(np.diff(total) >= 0.0) >= MIN_ADVANCING_SHARE and np.ptp(r) > 0.0 and np.any(r >= 1e-3 * ticks))
