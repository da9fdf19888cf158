"""Read JSON files: objects of arrays, arrays of objects, both nested, and a JSON value on each line.

- An object of arrays gives a column for each array, by its dotted path.
- A list of objects with numbers is a table, one row each; with lists of names and numbers, as messages of ROS have
  them, each name has its columns.
- A list of objects that each hold arrays over time is a list of recordings, such as trials.
- A list of objects with a name and one array each is a list of channels, perhaps with units.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ..personal_fields import PersonalField, find_personal_columns
from ..stated_units import unit_from_text
from ._acquisition_structs import plain_signals
from ._caps import require_few_columns, require_unpacked_size, unpacked_gzip
from ._columns import Columns
from ._flatten import flatten
from ._row_streams import MAX_LABELS, ListCell, Words, split_streams
from ._signals import Signals
from ._wall_clock import stamp_seconds

ENDINGS = (".json", ".jsonl", ".ndjson")

GZIP_SIGNATURE = b"\x1f\x8b"
"""First bytes of a packed file."""

MIN_ARRAY_SAMPLES = 8
"""An array over time has at least this many samples; a shorter one holds the values of several joints."""

MAX_FACT_LENGTH = 200
"""Longer texts are remarks, and no settings."""

MAX_FACTS = 200
"""At most so many settings are kept."""

_NAME_KEYS = ("name", "id", "label", "trial", "title", "channel", "signal", "key")
_UNIT_KEYS = ("unit", "units")
_COLUMN_NAME_KEYS = ("columns", "names", "channels", "labels", "fields", "header", "signals", "variables")
_INDEX_NAMES = re.compile(r"\d+")


def read(path: Path) -> Columns:
    """Return the numeric leaves of a JSON file by dotted path, each shape (n,) float64; booleans are 0 and 1."""
    try:
        parsed = _parsed(path)
        if isinstance(parsed, Mapping) and (plain := plain_signals(parsed)) is not None:
            signals = Signals(path)
            signals.add(plain, "")
            return signals.columns()
        found = _Content(path)
        found.add(parsed, "")
    except RecordingError:
        raise
    except (ValueError, RecursionError, EOFError, OSError, zlib.error) as error:
        raise RecordingError(f"{path.name}: not readable as JSON, truncated or damaged: {error}") from error
    return Columns(
        path,
        found.values,
        units=found.known_units(),
        facts=found.facts,
        personal=tuple(found.personal),
        recordings=tuple(found.recordings),
    )


def _parsed(path: Path) -> Any:
    """Return the value of a JSON file, or the list of values that its lines hold."""
    content = path.read_bytes()
    # openhdemg packs its files and keeps their ending.
    text = (unpacked_gzip(path, content) if content.startswith(GZIP_SIGNATURE) else content).decode("utf-8-sig")
    try:
        # Integers are read as floats, because JSON allows integers of any length.
        return json.loads(text, parse_int=float)
    except json.JSONDecodeError as error:
        lines = [line for line in text.splitlines() if line.strip()]
        if error.msg != "Extra data" or len(lines) < 2:
            raise
    return [json.loads(line, parse_int=float) for line in lines]


@dataclass
class _Content:
    """What has been found in a file."""

    path: Path
    values: dict[str, np.ndarray | str] = field(default_factory=dict)
    units: dict[str | int, str] = field(default_factory=dict)
    facts: dict[str, str] = field(default_factory=dict)
    personal: list[PersonalField] = field(default_factory=list)
    recordings: list[str] = field(default_factory=list)

    def known_units(self) -> dict[str | int, str]:
        """Return the units that are stated for columns."""
        return {name: unit_from_text(unit) or unit for name, unit in self.units.items() if name in self.values}

    def add(self, value: Any, prefix: str) -> None:
        """Add the numbers, units and settings of a value at a dotted path."""
        require_few_columns(self.path, len(self.values))
        if isinstance(value, Mapping):
            self._add_object(value, prefix)
        elif _is_list_of_objects(value):
            self._add_objects(value, prefix)
        elif isinstance(value, str):
            self._add_fact(prefix, value)
        else:
            arrays: dict[str, np.ndarray] = {}
            flatten(value, prefix, arrays, self.path)
            self.values |= arrays

    def _add_object(self, value: Mapping[str, Any], prefix: str) -> None:
        if (columns := _named_columns(value)) is not None:
            names, rows = columns
            require_few_columns(self.path, len(self.values) + len(names))
            self.values |= {_path(prefix, name): x for name, x in zip(names, rows.T.copy(), strict=True)}
            texts = next((value[key] for key in _UNIT_KEYS if _is_list_of_texts(value.get(key), len(names))), None)
            if texts is not None:
                self.units |= {_path(prefix, name): text for name, text in zip(names, texts, strict=True)}
            return
        if prefix and (channel := _channel(value)) is not None:
            self._add_channel(prefix, *channel)
            return
        if len(value) >= MIN_ARRAY_SAMPLES and all(map(_INDEX_NAMES.fullmatch, value)):
            # Pandas writes a column as an object of its rows' numbers.
            self.add(list(value.values()), prefix)
            return
        for key, item in value.items():
            if str(key).casefold() in _UNIT_KEYS and isinstance(item, Mapping):
                self.units |= {_path(prefix, name): unit for name, unit in item.items() if isinstance(unit, str)}
                continue
            self.add(item, _path(prefix, key))

    def _add_objects(self, items: Sequence[Mapping[str, Any]], prefix: str) -> None:
        channels = [_channel(item) for item in items]
        names = _item_names(items)
        if names is not None and all(channels):
            for name, channel in zip(names, channels, strict=True):
                if channel is not None:
                    self._add_channel(_path(prefix, name), *channel)
            return
        if not _are_recordings(items):
            self._add_rows(items, prefix)
            return
        if names is None or find_personal_columns([(_path(prefix, "name"), name) for name in names]):
            names = [str(i) for i in range(1, len(items) + 1)]
        for name, item in zip(names, items, strict=True):
            own = _path(prefix, name.replace(".", "_"))
            self.recordings.append(own)
            self.add(item, own)

    def _add_channel(self, name: str, samples: Sequence[Any], unit: str) -> None:
        flatten(samples, name, self.values, self.path)  # type: ignore[arg-type]
        if unit:
            self.units[name] = unit

    def _add_fact(self, name: str, text: str) -> None:
        found = find_personal_columns([(name, text)])
        self.personal += found
        if not found and name and text.strip() and len(text) <= MAX_FACT_LENGTH and len(self.facts) < MAX_FACTS:
            self.facts[name] = text.strip()

    def _add_rows(self, items: Sequence[Mapping[str, Any]], prefix: str) -> None:
        """Add a list of objects as a table; an object without a field has a missing sample there."""
        cells: dict[str, list[Any]] = {}
        for i, item in enumerate(items):
            for name, leaf in _leaves(item, prefix):
                if name not in cells:
                    require_few_columns(self.path, len(self.values) + len(cells) + 1)
                    cells[name] = [None] * i
                column = cells[name]
                column += [None] * (i - len(column))
                if len(column) == i:
                    column.append(leaf)
        require_unpacked_size(self.path, float(len(items)) * len(cells))
        table: dict[str, np.ndarray | str] = {}
        words: dict[str, Words] = {}
        lists: dict[str, list[ListCell | None]] = {}
        units: dict[str | int, str] = {}
        for name, column in cells.items():
            column += [None] * (len(items) - len(column))
            known = [leaf for leaf in column if leaf is not None]
            if known and all(isinstance(leaf, (bool, int, float)) for leaf in known):
                table[name] = np.array([np.nan if leaf is None else leaf for leaf in column], dtype=np.float64)
            elif known and all(isinstance(leaf, str) for leaf in known):
                self._add_texts(name, column, table, words, units)
            elif all(isinstance(leaf, list) for leaf in known):
                rows = [None if leaf is None else _list_cell(leaf) for leaf in column]
                if any(row is not None and len(row) for row in rows):
                    lists[name] = rows
                    table[name] = "lists"
        made, made_units = split_streams(self.path, table, units, words, lists)
        # Texts are left out, as everywhere in these files.
        self.values |= {name: x for name, x in made.items() if not isinstance(x, str)}
        self.units |= made_units

    def _add_texts(
        self,
        name: str,
        column: list[Any],
        table: dict[str, np.ndarray | str],
        words: dict[str, Words],
        units: dict[str | int, str],
    ) -> None:
        times = stamp_seconds(column) if None not in column else None
        if times is not None:
            table[name], units[name] = times, "s"
            return
        found = find_personal_columns([(name, next(text for text in column if text is not None))])
        texts = tuple(dict.fromkeys(text for text in column if text is not None))
        self.personal += found
        if len(texts) <= MAX_LABELS and not found:
            place = {text: i for i, text in enumerate(texts)}
            words[name] = Words(np.array([place.get(text, -1) for text in column]), texts)
            table[name] = "text"


def _path(prefix: str, key: object) -> str:
    return f"{prefix}.{key}" if prefix else str(key)


def _is_list_of_objects(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _is_list_of_texts(value: Any, count: int) -> bool:
    return isinstance(value, list) and len(value) == count > 0 and all(isinstance(item, str) for item in value)


def _leaves(value: Any, prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield numbers, texts and lists of an object by dotted path."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, _path(prefix, key))
    elif value is not None:
        yield prefix, value


def _list_cell(items: list[Any]) -> ListCell | None:
    """Return the numbers or the names of a list; None if it holds something else."""
    if items and all(isinstance(item, str) for item in items):
        return tuple(items)
    if all(item is None or isinstance(item, (bool, int, float)) for item in items):
        return np.array([np.nan if item is None else item for item in items], dtype=np.float64)
    try:
        return np.asarray(items, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        return None


def _is_array(value: Any) -> bool:
    """Whether a value is a list of numbers over time."""
    return (
        isinstance(value, list)
        and len(value) >= MIN_ARRAY_SAMPLES
        and all(item is None or isinstance(item, (bool, int, float)) for item in value)
        and not all(item is None for item in value)
    )


def _channel(value: Mapping[str, Any]) -> tuple[list[Any], str] | None:
    """Return the samples and the unit of an object that is one channel: one array with a name or unit."""
    arrays = [item for item in value.values() if isinstance(item, list) and item]
    if len(arrays) != 1 or not _is_array(arrays[0]) or any(isinstance(item, Mapping) for item in value.values()):
        return None
    unit = next((value[key] for key in value if str(key).casefold() in _UNIT_KEYS and isinstance(value[key], str)), "")
    is_named = any(str(key).casefold() in _NAME_KEYS for key in value)
    return (arrays[0], unit) if unit or is_named else None


def _named_columns(value: Mapping[str, Any]) -> tuple[list[str], np.ndarray] | None:
    """Return the names of columns and their rows, shape (n, columns), if an object lists both, as Pandas does."""
    for key in value:
        names = value[key]
        if str(key).casefold() not in _COLUMN_NAME_KEYS or not _is_list_of_texts(names, len(names or ())):
            continue
        for rows in value.values():
            is_table = isinstance(rows, list) and bool(rows) and all(isinstance(row, list) for row in rows)
            if is_table and {len(row) for row in rows} == {len(names)}:
                try:
                    return list(names), np.asarray(rows, dtype=np.float64)
                except (TypeError, ValueError):
                    continue
    return None


def _item_names(items: Sequence[Mapping[str, Any]]) -> list[str] | None:
    """Return a name for each object of a list, from the first key that gives each its own; None without one."""
    for wanted in _NAME_KEYS:
        found = [item.get(key) for item in items for key in item if str(key).casefold() == wanted]
        names = [f"{x:g}" if isinstance(x, float) else x for x in found if isinstance(x, (str, float)) and x != ""]
        if len(names) == len(items) and len(set(names)) == len(names):
            return [str(name) for name in names]
    return None


def _are_recordings(items: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether the objects of a list are separate recordings: each holds a table, or arrays over time.

    An object that is one row may hold arrays, too, such as the positions of all joints. Then a number in the same
    object rises from row to row, and no array rises within each.
    """
    tables = [_has_table(item) for item in items[:5]]
    if all(tables):
        return True
    arrays = [[leaf for _, leaf in _leaves(item, "") if _is_array(leaf)] for item in items[:5]]
    if not all(arrays):
        return False
    if all(any(_rises(array) for array in own) for own in arrays):
        return True
    scalars = [{k: v for k, v in _leaves(item, "") if isinstance(v, float)} for item in items]
    rising = len(items) > 2 and any(_rises([s.get(key) for s in scalars]) for key in scalars[0])
    return not rising and min(len(array) for own in arrays for array in own) > len(items)


def _has_table(value: Any) -> bool:
    """Whether a value holds a list of objects that is long enough for a table, or named columns."""
    if isinstance(value, Mapping):
        return _named_columns(value) is not None or any(_has_table(item) for item in value.values())
    return _is_list_of_objects(value) and len(value) >= MIN_ARRAY_SAMPLES


def _rises(values: Sequence[Any]) -> bool:
    known = [x for x in values if isinstance(x, (int, float))]
    return len(known) == len(values) > 1 and bool(np.all(np.diff(known) > 0.0))
