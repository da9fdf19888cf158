"""Turn stamps of a wall clock, as loggers write them, into seconds."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np

DAY_S = 86400.0
"""Seconds of a day."""

_CLOCK_PATTERN = r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2}(?:[.,]\d+|:\d{3})?)\s*(?P<half>[AaPp][Mm])?"
_ZONE_PATTERN = r"\s*(?P<zone>[Zz]|[+-]\d{2}:?\d{2})?"
_AFTER_DATE_PATTERN = rf"[T ]\s*{_CLOCK_PATTERN}{_ZONE_PATTERN}"
_YEAR_FIRST_PATTERN = re.compile(rf"(?P<year>\d{{4}})[-/.](?P<a>\d{{1,2}})[-/.](?P<b>\d{{1,2}}){_AFTER_DATE_PATTERN}")
_YEAR_LAST_PATTERN = re.compile(rf"(?P<a>\d{{1,2}})[-/.](?P<b>\d{{1,2}})[-/.](?P<year>\d{{4}}){_AFTER_DATE_PATTERN}")
_TIME_PATTERN = re.compile(_CLOCK_PATTERN)


def is_stamp(text: str) -> bool:
    """Return whether a text has the form of a stamp, with a date or without."""
    return any(form.fullmatch(text.strip()) for form in (_YEAR_FIRST_PATTERN, _YEAR_LAST_PATTERN, _TIME_PATTERN))


def stamp_seconds(stamps: Sequence[str]) -> np.ndarray | None:
    """Return the times of stamps, shape (n,) [s], or None if one of them is not a stamp of the others' form.

    With a date they count from 1970, in UTC; a stamp without a zone is taken for UTC. Without a date they count from
    midnight, and go on after the next midnight. A date alone is no time. If day and month could be exchanged, the
    reading with the shorter duration is taken.
    """
    if not stamps:
        return None
    for form, orders in ((_YEAR_FIRST_PATTERN, ("ab",)), (_YEAR_LAST_PATTERN, ("ba", "ab"))):
        found = [form.fullmatch(stamp.strip()) for stamp in stamps]
        whole = [match for match in found if match is not None]
        if len(whole) == len(stamps):
            readings = [times for order in orders if (times := _dated(whole, order)) is not None]
            return min(readings, key=np.ptp, default=None)
    alone = [_TIME_PATTERN.fullmatch(stamp.strip()) for stamp in stamps]
    seconds = [math.nan if match is None else _clock_seconds(match) for match in alone]
    if not np.isfinite(seconds).all():
        return None
    times = np.array(seconds)
    # A clock that falls by more than half a day has passed midnight.
    return times + DAY_S * np.concatenate(([0.0], np.cumsum(np.diff(times) < -DAY_S / 2)))


def _dated(stamps: list[re.Match[str]], order: str) -> np.ndarray | None:
    """Return the times of matched stamps whose groups `order` are month and day; None if a date does not exist."""
    times: list[float] = []
    for stamp in stamps:
        try:
            day = datetime(int(stamp["year"]), int(stamp[order[0]]), int(stamp[order[1]]), tzinfo=UTC)
        except ValueError:
            return None
        times.append(day.timestamp() + _clock_seconds(stamp) - _zone_seconds(stamp["zone"]))
    return np.array(times) if np.isfinite(times).all() else None


def _clock_seconds(stamp: re.Match[str]) -> float:
    """Return the seconds since midnight of a matched stamp; NaN if no clock shows it."""
    hour, minute, second = int(stamp["hour"]), int(stamp["minute"]), float(re.sub("[,:]", ".", stamp["second"]))
    if stamp["half"]:
        if not 1 <= hour <= 12:
            return math.nan
        hour = hour % 12 + (12 if stamp["half"].lower() == "pm" else 0)
    return 3600.0 * hour + 60.0 * minute + second if hour < 24 and minute < 60 and second < 61.0 else math.nan


def _zone_seconds(zone: str | None) -> float:
    """Return by how much a zone is ahead of UTC [s]."""
    if zone is None or zone in "Zz":
        return 0.0
    ahead = timedelta(hours=int(zone[1:3]), minutes=int(zone[-2:]))
    return ahead.total_seconds() * (-1.0 if zone[0] == "-" else 1.0)
