"""Split a table whose rows belong to different streams by turns, and cells that contain lists.

The contents of the cells distinguish three forms:

- A column of labels, ``time,joint,position``: each row is about the joint, motor or signal that it names.
- Lists in cells, ``"['hip', 'knee']","[0.1, 0.2]"``, as pandas writes messages: a column for each place, or for each
  name if another list names them. Rows with other sets of names, of an arm and of a gripper, are streams of their own.
- Names in columns of their own, ``name0,name1,position0,position1``, as ``rostopic echo -p`` writes them.

A new column is named by its old one and the label, ``position.knee``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from ..name_evidence import read_name, words_of
from ._caps import require_few_columns, require_unpacked_size
from ._columns import Columns
from ._split_stamps import with_whole_stamps

MAX_LABELS = 64
"""A column of labels has at most so many different ones; one with more holds remarks or file names."""

MIN_LABELLED_SHARE = 0.9
"""At least this share of the rows has a label, or a list."""

MIN_CHANGE_SHARE = 0.2
"""Labels that change at least at this share of the rows take turns; phases of a movement change more seldom."""

MIN_UNNAMED_CHANGE_SHARE = 0.8
"""The same for a column whose name does not say that it holds labels."""

MIN_ORDERED_SHARE = 0.9
"""Numbers are labels if at least this share of the rows follows the same number each time."""

MAX_CLOCK_SHARE = 0.2
"""Labels have one clock if their times differ by less than this share of a period, as messages sent in turn do."""

MAX_STREAMS = 16
"""Rows with lists belong to at most so many sets of names."""

_LABEL_WORDS = frozenset({
    "name", "names", "joint", "motor", "id", "topic", "axis", "actuator", "servo", "device", "node", "channel",
    "drive", "sensor", "signal", "variable", "field", "key", "measurement", "parameter", "label",
})  # fmt: skip
"""Words in the name of a column of labels."""

_VALUE_NAMES = frozenset({"value", "values", "val", "data"})
"""Names of the only column of numbers in a table whose labels are names of signals."""

_ARRAY_START = re.compile(r"array\(\s*(?:'\w'\s*,\s*)?")
_ARRAY_END = re.compile(r",\s*dtype=[\w.]{1,20}\)|\)")
_NAME_COLUMN = re.compile(r"(.*?)(?:joint_)?names?[._\[]?(\d+)\]?", re.IGNORECASE)
_NUMBERED_COLUMN = re.compile(r"(.*?[^\d._\[])[._\[]?(\d+)\]?")

ListCell: TypeAlias = np.ndarray | tuple[str, ...]


@dataclass(frozen=True)
class Words:
    """A column of words: the place of each row's word in `texts`, shape (n,); -1 where there is none."""

    codes: np.ndarray
    texts: tuple[str, ...]


def parse_list(text: str) -> ListCell | None:
    """Return the numbers, shape (k,), or the names that a cell lists; None if it is no list."""
    bare = text.strip()
    if (start := _ARRAY_START.match(bare)) is not None:
        bare = bare[start.end() :]
        close = bare.rfind("]") + 1
        bare = bare[:close] if _ARRAY_END.fullmatch(bare[close:].strip()) else ""
    if len(bare) < 2 or bare[0] + bare[-1] not in ("[]", "()", "{}"):
        return None
    inner = bare[1:-1].replace(";", ",").strip(", ")
    parts = [part.strip() for part in inner.split(",")] if "," in inner else inner.split()
    try:
        return np.array(parts, dtype=np.float64)
    except ValueError:
        names = tuple(part.strip("'\" ") for part in parts)
        return names if all(names) and not any(set(name) & set("[](){}") for name in names) else None


def split_streams(
    path: Path,
    values: Mapping[str, np.ndarray | str],
    units: Mapping[str | int, str],
    words: Mapping[str, Words],
    lists: Mapping[str, Sequence[ListCell | None]],
) -> tuple[dict[str, np.ndarray | str], dict[str | int, str]]:
    """Return the columns of a table, taken apart by its lists and labels, and their units.

    Parameters
    ----------
    path : Path
        The file, for messages.
    values : mapping of str to ndarray or str
        Columns of numbers, shape (n,); a str describes one of text.
    units : mapping of str to str
        Their units.
    words : mapping of str to Words
        Columns of words among them.
    lists : mapping of str to sequence of ndarray, tuple or None
        Columns of lists among them, n entries each.
    """
    # The parts of a stamp are known by their names, which get a label here.
    whole = with_whole_stamps(Columns(path, values, units=units))
    values, units = whole.values, whole.units
    found, numbered = _numbered_lists(values, words)
    lists = {**lists, **numbered}
    if lists:
        return _split_lists(path, found, units, lists)
    if isinstance(found, dict) and found.keys() != values.keys():
        renamed = _renamed(values, words)
        return dict(found), {renamed.get(str(name), name): unit for name, unit in units.items()}
    label = _label_column(values, words)
    if label is None:
        return dict(values), dict(units)
    return _split_labels(path, values, {**units, **_units_of_labels(words, label[1], label[2])}, *label)


def _renamed(values: Mapping[str, np.ndarray | str], words: Mapping[str, Words]) -> dict[str, str]:
    """Return new names of numbered columns by their old ones, from columns with one name each throughout."""
    names: dict[tuple[str, str], str] = {}
    for column, found in words.items():
        match = _NAME_COLUMN.fullmatch(column)
        if match is not None and len(found.texts) == 1:
            names[match[1], match[2]] = found.texts[0]
    if not names:
        return {}
    renamed: dict[str, str] = {}
    for column, x in values.items():
        match = _NUMBERED_COLUMN.fullmatch(column)
        if match is None or isinstance(x, str):
            continue
        name = next((text for (stem, i), text in names.items() if i == match[2] and match[1].startswith(stem)), None)
        if name is not None:
            renamed[column] = f"{match[1]}.{name}"
    return renamed if len(set(renamed.values())) == len(renamed) else {}


def _numbered_lists(
    values: Mapping[str, np.ndarray | str], words: Mapping[str, Words]
) -> tuple[Mapping[str, np.ndarray | str], dict[str, Sequence[ListCell | None]]]:
    """Return the columns with the names that columns such as ``name0`` give to ``position0``, and lists of those whose
    names change from row to row."""
    name_columns = {column: match for column in words if (match := _NAME_COLUMN.fullmatch(column))}
    if not name_columns:
        return values, {}
    if all(len(words[column].texts) == 1 for column in name_columns):
        renamed = _renamed(values, words)
        return {renamed.get(name, name): x for name, x in values.items()}, {}
    by_stem: dict[str, list[str]] = {}
    for column, match in name_columns.items():
        by_stem.setdefault(match[1], []).append(column)
    rest, lists = dict(values), dict[str, Sequence[ListCell | None]]()
    for stem, columns in by_stem.items():
        places = [name_columns[column][2] for column in columns]
        texts = [(*words[column].texts, "") for column in columns]
        codes = np.stack([words[column].codes for column in columns], axis=1)
        fields: dict[str, dict[str, str]] = {}
        for column, x in values.items():
            match = _NUMBERED_COLUMN.fullmatch(column)
            if match is not None and not isinstance(x, str) and match[1].startswith(stem) and match[2] in places:
                fields.setdefault(match[1], {})[match[2]] = column
        fields = {name: own for name, own in fields.items() if set(own) == set(places)}
        if not fields:
            continue
        known = (codes >= 0).sum(axis=1)
        rows = [tuple(t[c] for t, c in zip(texts, row, strict=True) if c >= 0) for row in codes.tolist()]
        lists[f"{stem}name"] = rows
        for name, own in fields.items():
            table = np.stack([np.asarray(values[own[place]]) for place in places], axis=1)
            lists[name] = [row[:k] for row, k in zip(table, known, strict=True)]
        for column in (*columns, *(c for own in fields.values() for c in own.values())):
            rest.pop(column, None)
    return rest, lists


def _split_lists(
    path: Path,
    values: Mapping[str, np.ndarray | str],
    units: Mapping[str | int, str],
    lists: Mapping[str, Sequence[ListCell | None]],
) -> tuple[dict[str, np.ndarray | str], dict[str | int, str]]:
    """Return the columns of a table with lists: one for each entry, in a stream for each set of names."""
    names = next((rows for rows in lists.values() if _mostly(rows, tuple)), None)
    numeric = {column: rows for column, rows in lists.items() if _mostly(rows, np.ndarray)}
    count = len(next(iter(lists.values())))
    require_unpacked_size(path, sum(float(len(row)) for rows in numeric.values() for row in rows if row is not None))
    streams: dict[object, list[int]] = {}
    for i in range(count):
        own = names[i] if names is not None else None
        if isinstance(own, tuple):
            streams.setdefault(frozenset(own), []).append(i)
        else:
            lengths = tuple(len(row) for rows in numeric.values() if (row := rows[i]) is not None)
            if lengths:
                streams.setdefault(lengths, []).append(i)
    # Damage gives sets of its own, with a row or two each.
    kept = _joined({key: rows for key, rows in streams.items() if len(rows) >= max(2, 0.001 * count)})
    if not kept or len(kept) > MAX_STREAMS:
        return dict(values), dict(units)
    made: dict[str, np.ndarray | str] = {}
    new_units: dict[str | int, str] = {}
    for place, rows in enumerate(kept):
        own_names = _all_names(names, rows)
        # The stream with the most numbers keeps the names of the columns beside the lists.
        label = "" if place == 0 else f".{own_names[0]}" if own_names else f".{place}"
        for column, x in values.items():
            if column not in lists:
                made[f"{column}{label}"] = x if isinstance(x, str) else x[rows]
                if column in units:
                    new_units[f"{column}{label}"] = units[column]
        for column, cells in numeric.items():
            width = max((len(cell) for i in rows if (cell := cells[i]) is not None), default=0)
            is_named = own_names is not None and _are_named(names, cells, rows)
            width = len(own_names or ()) if is_named else width
            require_few_columns(path, len(made) + width)
            table = np.full((len(rows), width), np.nan)
            for k, i in enumerate(rows):
                cell, order = cells[i], names[i] if names is not None else None
                if cell is None:
                    continue
                if is_named and isinstance(order, tuple) and order != own_names:
                    table[k] = [dict(zip(order, cell, strict=True)).get(name, np.nan) for name in own_names or ()]
                else:
                    table[k, : len(cell)] = cell
            for j in range(width):
                name = f"{column}.{own_names[j]}" if is_named and own_names else f"{column}.{j}{label}"
                made[name] = np.ascontiguousarray(table[:, j])
                if column in units:
                    new_units[name] = units[column]
    return made, new_units


def _joined(streams: Mapping[object, list[int]]) -> list[list[int]]:
    """Return the rows of each stream, the one with the most names first; sets that share a name are one stream."""
    groups: list[tuple[set[object], list[int]]] = []
    for key, rows in streams.items():
        names = set(key) if isinstance(key, frozenset) else {key}
        meeting = [group for group in groups if group[0] & names]
        groups = [group for group in groups if group not in meeting]
        joined = sorted(rows + [i for _, own in meeting for i in own])
        groups.append((names.union(*(own for own, _ in meeting)), joined))
    groups.sort(key=lambda group: (-len(group[0]), group[1][0]))
    return [rows for _, rows in groups]


def _all_names(names: Sequence[ListCell | None] | None, rows: Sequence[int]) -> tuple[str, ...] | None:
    """Return the names that rows list, in the order of the first one; None if they list none."""
    if names is None:
        return None
    found = dict.fromkeys(name for i in rows if isinstance(own := names[i], tuple) for name in own)
    return tuple(found) or None


def _are_named(names: Sequence[ListCell | None] | None, cells: Sequence[ListCell | None], rows: Sequence[int]) -> bool:
    """Whether each row's list has as many entries as the row has names."""
    if names is None:
        return False
    pairs = [(cells[i], names[i]) for i in rows if cells[i] is not None]
    return bool(pairs) and all(own is not None and len(cell) == len(own) for cell, own in pairs if cell is not None)


def _mostly(rows: Sequence[ListCell | None], kind: type) -> bool:
    """Whether nearly every row holds a list of a kind, and one of them is not empty."""
    own = sum(1 for row in rows if isinstance(row, kind))
    return own >= MIN_LABELLED_SHARE * len(rows) > 0 and any(row is not None and len(row) for row in rows)


def _label_column(
    values: Mapping[str, np.ndarray | str], words: Mapping[str, Words]
) -> tuple[str, np.ndarray, tuple[str, ...]] | None:
    """Return the column whose labels say what a row is about, its codes, shape (n,), and labels; None without one."""
    for column, x in values.items():
        is_named = bool(set(words_of(column)) & _LABEL_WORDS)
        if column in words:
            codes, labels = words[column].codes, words[column].texts
        elif (
            is_named and not isinstance(x, str) and len(x) > 1 and np.isfinite(x).all() and not np.any(x != np.rint(x))
        ):
            found, codes = np.unique(x, return_inverse=True)
            stem = re.sub(r"[\W_]*(?:id|number|no|nr|index)$", "", column, flags=re.IGNORECASE) or column
            labels = tuple(f"{stem}_{int(label)}" for label in found[: MAX_LABELS + 1])
        else:
            continue
        if not 2 <= len(labels) <= MAX_LABELS or np.mean(codes >= 0) < MIN_LABELLED_SHARE:
            continue
        known = codes[codes >= 0]
        changes = float(np.mean(known[1:] != known[:-1])) if len(known) > 1 else 0.0
        counts = np.bincount(known, minlength=len(labels))
        if counts.min() < 2:
            continue
        if column in words:
            takes_turns = changes >= (MIN_CHANGE_SHARE if is_named else MIN_UNNAMED_CHANGE_SHARE)
        else:
            # A state or a reading of few steps changes often, too, but in no order.
            takes_turns = changes >= MIN_UNNAMED_CHANGE_SHARE and _has_order(codes)
        if takes_turns or (is_named and _restarts(values, codes)):
            return column, codes, labels
    return None


def _has_order(codes: np.ndarray) -> bool:
    """Whether each label is nearly always followed by the same one."""
    pairs = Counter(zip(codes[:-1].tolist(), codes[1:].tolist(), strict=True))
    usual: dict[int, int] = {}
    for (before, _), count in pairs.items():
        usual[before] = max(usual.get(before, 0), count)
    return sum(usual.values()) >= MIN_ORDERED_SHARE * (len(codes) - 1)


def _restarts(values: Mapping[str, np.ndarray | str], codes: np.ndarray) -> bool:
    """Whether a column rises throughout the rows of each label and falls where the label changes."""
    change = np.diff(codes) != 0
    for x in values.values():
        if isinstance(x, str) or len(x) != len(codes) or not change.any():
            continue
        step = np.diff(x)
        if np.all(step[change] < 0.0) and np.all(step[~change] > 0.0):
            return True
    return False


def _units_of_labels(words: Mapping[str, Words], codes: np.ndarray, labels: Sequence[str]) -> dict[str | int, str]:
    """Return the unit of each label, from a column of units that is constant for every label."""
    found: dict[str | int, str] = {}
    for column, own in words.items():
        if column.rpartition(".")[2].casefold() not in ("unit", "units"):
            continue
        for code, label in enumerate(labels):
            stated = np.unique(own.codes[codes == code])
            if len(stated) == 1 and stated[0] >= 0:
                found[label] = own.texts[stated[0]]
    return found


def _is_one_clock(parts: Sequence[np.ndarray]) -> bool:
    """Whether several columns of times are one: equal, or apart by less than a small share of a period."""
    if any(len(part) != len(parts[0]) for part in parts):
        return False
    if all(np.array_equal(part, parts[0], equal_nan=True) for part in parts):
        return True
    steps = np.diff(parts[0])
    period = float(np.median(steps)) if len(steps) and np.all(steps >= 0.0) else 0.0
    return all(float(np.max(np.abs(part - parts[0]))) < MAX_CLOCK_SHARE * period for part in parts)


def _split_labels(
    path: Path,
    values: Mapping[str, np.ndarray | str],
    units: Mapping[str | int, str],
    column: str,
    codes: np.ndarray,
    labels: tuple[str, ...],
) -> tuple[dict[str, np.ndarray | str], dict[str | int, str]]:
    """Return the columns of a table with a column for each label, and their units."""
    rows = [np.flatnonzero(codes == code) for code in range(len(labels))]
    numeric = {name: x for name, x in values.items() if not isinstance(x, str) and name != column}
    require_few_columns(path, len(numeric) * len(labels))
    fewest = min(map(len, rows))
    if max(map(len, rows)) <= fewest + 1:
        rows = [own[:fewest] for own in rows]  # the log ended within a turn
    made: dict[str, np.ndarray | str] = {}
    new_units: dict[str | int, str] = {}
    own_values = [name for name in numeric if name.rpartition(".")[2].casefold() in _VALUE_NAMES]
    for name, x in numeric.items():
        parts = [x[own] for own in rows]
        is_clock = name == next(iter(numeric)) or read_name(name).quantity in ("time", "counter")
        if is_clock and _is_one_clock(parts):
            # What every label shares, such as the time, is one column.
            made[name] = parts[0]
            if name in units:
                new_units[name] = units[name]
            continue
        for label, part in zip(labels, parts, strict=True):
            if np.isnan(part).all():
                continue  # this label's rows do not have this field
            own = label if own_values == [name] else f"{name}.{label}"
            made[own] = part
            if name in units:
                new_units[own] = units[name]
            elif own == label and label in units:
                new_units[own] = units[label]
    return made, new_units
