"""Turn messages on topics, as robots' logs hold them, into columns.

A number of a message is the column of its topic and its dotted path, ``arm/state.effort``, at the times of the column
``arm/state.time``. Numbers in a list are numbered, or named if the message lists as many names, as joint states of ROS
do: ``joint_states.position.elbow``. A stamp of seconds and nanoseconds is one column.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ._caps import require_few_columns, require_unpacked_size
from ._columns import Columns

STAMP_PARTS = ({"sec", "nanosec"}, {"secs", "nsecs"}, {"sec", "nsec"})
"""Names of a stamp's seconds and nanoseconds in ROS 2, ROS 1 and other logs."""

NAME_FIELDS = ("name", "names", "joint_names")
"""Fields of a message that may name the numbers in its lists."""


class Topics:
    """Messages of one file, collected by topic."""

    def __init__(self, path: Path):
        self._path = path
        self._rows: dict[str, list[dict[str, float]]] = {}
        self._times: dict[str, list[int]] = {}
        self._number_count = 0

    def add(self, topic: str, time: int, message: Any) -> None:
        """Add a message of a topic at a time [ns]."""
        row: dict[str, float] = {}
        _flatten_message(message, "", row)
        self._number_count += len(row) + 1
        require_few_columns(self._path, len(row))
        require_unpacked_size(self._path, self._number_count)
        self._rows.setdefault(topic.strip("/"), []).append(row)
        self._times.setdefault(topic.strip("/"), []).append(time)

    @property
    def is_empty(self) -> bool:
        """Whether no message has been added."""
        return not self._rows

    def columns(self) -> Columns:
        """Return the columns of all topics that hold numbers; time 0 is the file's first message."""
        values: dict[str, np.ndarray | str] = {}
        units: dict[str | int, str] = {}
        start = min((min(times) for times in self._times.values()), default=0)
        for topic, rows in self._rows.items():
            names = dict.fromkeys(name for row in rows for name in row)
            require_few_columns(self._path, len(values) + len(names))
            require_unpacked_size(self._path, float(len(rows)) * len(names))
            if not names:
                continue
            # Differences of whole nanoseconds are exact.
            values[f"{topic}.time"] = np.array([time - start for time in self._times[topic]], dtype=np.float64) / 1e9
            units[f"{topic}.time"] = "s"
            for name in names:
                values[f"{topic}.{name}"] = np.array([row.get(name, np.nan) for row in rows], dtype=np.float64)
        if not values:
            raise RecordingError(f"{self._path.name}: found no message with numbers, expected some")
        return Columns(self._path, values, units=units)


def _flatten_message(value: Any, prefix: str, row: dict[str, float]) -> None:
    """Add the numbers of a message to a row, by their dotted path."""
    if isinstance(value, (bool, int, float, np.number, np.bool_)):
        row[prefix] = float(value)
        return
    if is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in fields(value) if not field.name.startswith("__")}
    if isinstance(value, Mapping):
        if set(value) in STAMP_PARTS:
            seconds, nanoseconds = sorted(value, key=lambda key: "n" in key.lower())
            row[prefix] = float(value[seconds]) + 1e-9 * float(value[nanoseconds])
            return
        names = next((list(value[key]) for key in NAME_FIELDS if _is_list_of_names(value.get(key))), None)
        for key, item in value.items():
            path = f"{prefix}.{key}" if prefix else str(key)
            if names and isinstance(item, (list, tuple, np.ndarray)) and len(item) == len(names):
                _flatten_message(dict(zip(names, item, strict=True)), path, row)
            else:
                _flatten_message(item, path, row)
    elif isinstance(value, (list, tuple, np.ndarray)):
        for i, item in enumerate(value):
            _flatten_message(item, f"{prefix}.{i}" if prefix else str(i), row)


def _is_list_of_names(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and bool(value) and all(isinstance(name, str) for name in value)
