"""Turn messages on topics, as robots' logs hold them, into columns.

A number of a message is the column of its topic and its dotted path, ``arm/state.effort``, at the times of the column
``arm/state.time``. Numbers in a list are numbered, or named if the message lists as many names, as joint states of ROS
do: ``joint_states.position.elbow``. A stamp of seconds and nanoseconds is one column.

Times are those in the messages' headers, at which was measured; where headers have none, those at which the log got
the messages. Messages of one topic that name other joints, such as those of an arm and its gripper by turns, are apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ._caps import require_few_columns, require_unpacked_size
from ._columns import Columns

STAMP_PARTS = ({"sec", "nanosec"}, {"secs", "nsecs"}, {"sec", "nsec"})
"""Names of a stamp's seconds and nanoseconds in ROS 2, ROS 1 and other logs."""

NAME_FIELDS = ("name", "names", "joint_names", "dof_names")
"""Fields of a message that may name the numbers in its lists."""

INTERFACE_FIELDS = {"interface_names", "values"}
"""Fields of each joint's part of a dynamic joint state: names of quantities, and their values."""

ARRAY_FIELDS = {"layout", "data"}
"""Fields of a multi-array of std_msgs; its layout only says how many numbers its data are."""

MAX_NUMBERS_A_MESSAGE = 1000
"""A message with more numbers than this is a picture, a scan or a map; its topic is excluded."""

MAX_CLOCK_DIFFERENCE_S = 60.0
"""Stamps that differ by more from the times of the log are of a clock with another start, such as a simulation's."""

MAX_PUBLISHERS = 20
"""A topic with more sets of names than this lists things that come and go, and not the joints of its publishers."""

MIN_ADVANCING_SHARE = 0.9
"""Stamps are times if they do not fall in at least this share of the messages."""


class Topics:
    """Messages of one file, collected by topic."""

    def __init__(self, path: Path):
        self._path = path
        self._topics: dict[str, _Topic] = {}
        self._left_out: dict[str, str] = {}
        self._number_count = 0

    def add(self, topic: str, time: int, message: Any) -> None:
        """Add a message of a topic, which the log got at a time [ns]."""
        topic = topic.strip("/")
        row: dict[str, float] = {}
        try:
            _flatten_message(message, "", row, ())
        except _TooWideError as error:
            self.leave_out(topic, f"holds {error.args[0]} numbers a message or more, such as a picture or a scan")
            return
        self._number_count += len(row) + 1
        require_unpacked_size(self._path, self._number_count)
        found = self._topics.setdefault(topic, _Topic())
        found.rows.append(row)
        found.arrivals.append(time)
        found.stamps.append(_stamp_of(message))
        found.names.append(_names_of(message))

    def is_left_out(self, topic: str) -> bool:
        """Whether the messages of a topic need not be decoded."""
        return topic.strip("/") in self._left_out

    def leave_out(self, topic: str, why: str) -> None:
        """Leave out the messages of a topic, whose column says why."""
        self._left_out[topic.strip("/")] = why

    def columns(self) -> Columns:
        """Return the columns of all topics that hold numbers; time 0 is the file's first message."""
        values: dict[str, np.ndarray | str] = {}
        units: dict[str | int, str] = {}
        parts = [
            (f"{name}_{part.label}" if part.label else name, part)
            for name, topic in self._topics.items()
            for part in topic.parts()
        ]
        times = [part.times() for _, part in parts]
        start = min((min(each) for each, (_, part) in zip(times, parts, strict=True) if any(part.rows)), default=0)
        for each, (topic, part) in zip(times, parts, strict=True):
            names = dict.fromkeys(name for row in part.rows for name in row)
            require_few_columns(self._path, len(values) + len(names))
            require_unpacked_size(self._path, float(len(part.rows)) * len(names))
            if not names:
                continue
            # Differences of whole nanoseconds are exact.
            values[f"{topic}.time"] = np.array([time - start for time in each], dtype=np.float64) / 1e9
            units[f"{topic}.time"] = "s"
            for name in names:
                values[f"{topic}.{name}"] = np.array([row.get(name, np.nan) for row in part.rows], dtype=np.float64)
                if name == "header.stamp":
                    units[f"{topic}.{name}"] = "s"
        if not values:
            why = next((f"; topic {topic} {text}" for topic, text in self._left_out.items()), "")
            raise RecordingError(f"{self._path.name}: found no message with numbers, expected some{why}")
        texts = {topic: text for topic, text in self._left_out.items() if topic not in self._topics}
        return Columns(self._path, {**values, **texts}, units=units)


@dataclass
class _Topic:
    """Messages of one topic, in the log's order."""

    label: str = ""  # what tells a part of a topic from the rest
    rows: list[dict[str, float]] = field(default_factory=list)
    arrivals: list[int] = field(default_factory=list)  # times at which the log got them [ns]
    stamps: list[int] = field(default_factory=list)  # times in their headers [ns], 0 for none
    names: list[frozenset[str]] = field(default_factory=list)  # joints that they name

    def times(self) -> list[int]:
        """Return the times in the headers [ns], on the log's clock; those of the log if headers have none."""
        stamps, arrivals = np.array(self.stamps, np.int64), np.array(self.arrivals, np.int64)
        advances = np.diff(stamps) >= 0
        if stamps.min() <= 0 or (len(stamps) > 1 and (stamps.max() == stamps.min() or not
                                                      np.mean(advances) >= MIN_ADVANCING_SHARE)):  # fmt: skip
            return self.arrivals
        offset = int(np.median(arrivals - stamps))
        return self.stamps if abs(offset) < 1e9 * MAX_CLOCK_DIFFERENCE_S else (stamps + offset).tolist()

    def parts(self) -> list[_Topic]:
        """Return the messages that name the same joints apart from those that name others.

        Sets of names that share a joint belong together. The part with the most names keeps the topic's name.
        """
        groups: list[frozenset[str]] = []
        for names in dict.fromkeys(self.names):
            meeting = [group for group in groups if group & names or group == names]
            groups = [group for group in groups if group not in meeting] + [names.union(*meeting)]
            if len(groups) > MAX_PUBLISHERS:
                return [self]
        if len(groups) < 2:
            return [self]
        groups.sort(key=lambda group: (-len(group), sorted(group)))
        made = {group: _Topic("_".join(sorted(group)[:1]) if i else "") for i, group in enumerate(groups)}
        place = {names: next(part for group, part in made.items() if names <= group and (names or not group))
                 for names in set(self.names)}  # fmt: skip
        for row, arrival, stamp, names in zip(self.rows, self.arrivals, self.stamps, self.names, strict=True):
            part = place[names]
            part.rows.append(row)
            part.arrivals.append(arrival)
            part.stamps.append(stamp)
            part.names.append(names)
        return list(made.values())


class _TooWideError(Exception):
    """A message has too many numbers."""


def _flatten_message(value: Any, prefix: str, row: dict[str, float], names: Sequence[str]) -> None:
    """Add the numbers of a message to a row, by their dotted path; lists as long as `names` are named by them."""
    if isinstance(value, (bool, int, float, np.number, np.bool_)):
        row[prefix] = float(value)
        if len(row) > MAX_NUMBERS_A_MESSAGE:
            raise _TooWideError(len(row))
        return
    value = _as_mapping(value)
    if isinstance(value, Mapping):
        if set(value) in STAMP_PARTS:
            row[prefix] = 1e-9 * _nanoseconds(value)
            return
        names = _listed_names(value) or names
        for key, item in value.items():
            if set(value) == ARRAY_FIELDS and key == "layout":
                continue
            path = f"{prefix}.{key}" if prefix else str(key)
            if names and isinstance(item, (list, tuple, np.ndarray)) and len(item) == len(names):
                _flatten_named(names, item, path, row)
            else:
                _flatten_message(item, path, row, names)
    elif isinstance(value, (list, tuple, np.ndarray)):
        if len(value) > MAX_NUMBERS_A_MESSAGE and not isinstance(value[0], str):
            raise _TooWideError(len(value))
        for i, item in enumerate(value):
            _flatten_message(item, f"{prefix}.{i}" if prefix else str(i), row, ())


def _flatten_named(names: Sequence[str], items: Any, path: str, row: dict[str, float]) -> None:
    """Add the entries of a list by their names; of a dynamic joint state, by quantity and then by joint."""
    for name, item in zip(names, items, strict=True):
        part = _as_mapping(item)
        if isinstance(part, Mapping) and set(part) == INTERFACE_FIELDS:
            before = path.rpartition(".")[0]
            for quantity, number in zip(part["interface_names"], part["values"], strict=False):
                _flatten_message(number, f"{before}.{quantity}.{name}" if before else f"{quantity}.{name}", row, ())
        else:
            _flatten_message(item, f"{path}.{name}", row, ())


def _as_mapping(value: Any) -> Any:
    """Return a message as a mapping of its fields; anything else as it is."""
    if is_dataclass(value) and not isinstance(value, type):
        return {part.name: getattr(value, part.name) for part in fields(value) if not part.name.startswith("__")}
    return value


def _nanoseconds(stamp: Mapping[str, Any]) -> int:
    seconds, nanoseconds = sorted(stamp, key=lambda key: "n" in key.lower())
    return int(stamp[seconds]) * 10**9 + int(stamp[nanoseconds])


def _stamp_of(message: Any) -> int:
    """Return the time in a message's header or among its fields [ns]; 0 if it has none."""
    parts = _as_mapping(message)
    if not isinstance(parts, Mapping):
        return 0
    header = _as_mapping(parts.get("header"))
    stamps = (header.get("stamp") if isinstance(header, Mapping) else None, parts.get("stamp"), parts.get("timestamp"))
    for stamp in map(_as_mapping, stamps):
        if isinstance(stamp, Mapping) and set(stamp) in STAMP_PARTS:
            return _nanoseconds(stamp)
    return 0


def _names_of(message: Any) -> frozenset[str]:
    """Return the joints that a message names; none if it names no list's entries."""
    parts = _as_mapping(message)
    return frozenset(_listed_names(parts)) if isinstance(parts, Mapping) else frozenset()


def _listed_names(parts: Mapping[str, Any]) -> tuple[str, ...]:
    return next((tuple(parts[key]) for key in NAME_FIELDS if _is_list_of_names(parts.get(key))), ())


def _is_list_of_names(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and bool(value) and all(isinstance(name, str) for name in value)
