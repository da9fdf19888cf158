"""Read the files that a lab has, and tell tables, robots' files and files that are not read apart."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from .._errors import PellucidError, RecordingError, StudyError
from ..arm.urdf import read_urdf
from ..files.defects.garbage import zeroed_rows
from ..files.file_facts import stated_units
from ..files.name_evidence import read_name, words_of
from ..files.personal_fields import PersonalField
from ..files.readers import Columns, describes_files, read_columns
from ..files.readers._comma import TWO_READINGS
from .inference.emg_spectrum import FlatShape, common_rows, find_flat_shape

MODEL_ENDINGS = (".urdf", ".osim", ".xml", ".osimx")
"""Endings of files of models. They are named, and a robot's file gives its joints."""

IGNORED_ENDINGS = (
    ".pdf", ".md", ".yaml", ".yml", ".toml", ".py", ".m", ".html", ".png", ".jpg", ".svg", ".zip", ".docx",
)  # fmt: skip
"""Endings of files that are no recordings."""

SHEET_ENDINGS = (".xlsx", ".xlsm", ".ods")
"""Endings of workbooks."""

MAX_READ_NUMBER = 1e100
"""Largest number of a table that is one; times in nanoseconds since 1970 have 19 digits."""

MIN_TABLE_ROWS = 8
"""A table has at least so many rows; shorter columns are constants and settings."""

_FILE_WORDS_BY_QUANTITY = {
    "angle": "ik angle angles ikdata kinematics",
    "torque": "id moment moments iddata torque torques tau trq effort efforts",
    "position": "position positions pos q qpos",
    "velocity": "velocity velocities vel dq qd qvel",
    "acceleration": "acceleration accelerations acc ddq qdd",
    "current": "current currents curr cur",
    "voltage": "voltage voltages",
    "force": "force forces grf",
    "emg": "emg emgs semg emgdata",
    "length": "length lengths",
}

QUANTITY_BY_FILE_WORD = {word: kind for kind, words in _FILE_WORDS_BY_QUANTITY.items() for word in words.split()}
"""Quantities by words in the names of files and folders, which complement the names of columns."""


_TRIAL_NAME = re.compile(
    r"(?:trial|run|rep|repetition|test|take|session|recording|rec|measurement|experiment|sweep|versuch|messung|lauf)"
    r"[\s_-]*\d+",
    re.IGNORECASE,
)
"""Names of one of several recordings in a file."""


@dataclass(frozen=True, eq=False)
class GivenTable:
    """Columns of one length in a file."""

    path: Path
    columns: Mapping[str, np.ndarray]  # columns by name, each shape (n,)
    key: str = ""  # part of the names that the table's columns share, such as a sheet
    units: Mapping[str, str] = field(default_factory=dict)
    angle_unit: str | None = None
    facts: Mapping[str, str] = field(default_factory=dict)  # labelled settings, and constants of the file
    personal: tuple[PersonalField, ...] = ()
    quantity: str | None = None  # quantity that the file's or its folder's name says
    flat: Mapping[str, tuple[str, int, int]] = field(default_factory=dict)  # order, number and count of a flat column
    texts: tuple[str, ...] = ()  # columns of text, which are left out

    @property
    def rows(self) -> int:
        """Number of rows."""
        return max((len(x) for x in self.columns.values()), default=0)

    @property
    def signature(self) -> tuple[object, ...]:
        """What tables of one layout share: names of the columns, the quantity, and how flat lists are divided."""
        ownless = tuple(name.removeprefix(f"{self.key}.") if self.key else name for name in self.columns)
        about = self.path.stem.casefold().rpartition("momentarm")[2] if self.quantity == "moment_arm" else ""
        return ownless, self.quantity, about, tuple(self.flat.values()), self.path.suffix.lower()


@dataclass(frozen=True)
class GivenFiles:
    """What the files hold."""

    tables: tuple[GivenTable, ...]
    robots: tuple[Path, ...]  # robots' files
    models: tuple[Path, ...]  # other models, such as OpenSim's
    unread: tuple[tuple[Path, str], ...]  # files that are not read, with the reason

    def with_robot(self, path: Path) -> GivenFiles:
        """Return the files with the robot's file that was named before others; raise an error if it is none."""
        read_urdf(path)
        others = (robot for robot in self.robots if robot.absolute() != path.absolute())
        return replace(self, robots=(path, *others))


def read_given(files: Iterable[str | os.PathLike]) -> GivenFiles:
    """Read files, and all files in folders; raise a StudyError if none of them is a table of numbers."""
    paths = _expand(files)
    tables: list[GivenTable] = []
    robots, models, unread = [], [], list[tuple[Path, str]]()
    for path in paths:
        if path.suffix.lower() == ".urdf":
            robots.append(path)
            continue
        if path.suffix.lower() in MODEL_ENDINGS:
            models.append(path)
            continue
        if path.suffix.lower() in IGNORED_ENDINGS or describes_files(path):
            unread.append((path, "no recording by its name"))
            continue
        try:
            found = tables_of_columns(read_columns(path))
        except PellucidError as error:
            unread.append((path, str(error).removeprefix(f"{path.name}: ")))
            continue
        if found:
            tables += found
        else:
            unread.append((path, f"it has no column of at least {MIN_TABLE_ROWS} numbers"))
    tables = _split_flat_files(tables)
    if not tables:
        reasons = "; ".join(f"{path.name}: {why}" for path, why in unread[:5])
        files = "1 file" if len(paths) == 1 else f"{len(paths)} files"
        raise StudyError(f"found no table of numbers in {files}: {reasons or 'none given'}")
    return GivenFiles(tuple(tables), tuple(robots), tuple(models), tuple(unread))


def _expand(files: Iterable[str | os.PathLike]) -> list[Path]:
    paths: list[Path] = []
    for given in files:
        path = Path(given)
        if path.is_dir():
            paths += sorted(p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
        elif path.is_file():
            paths.append(path)
        else:
            raise StudyError(f"{path}: no such file, expected a recording or a folder of recordings")
    return list(dict.fromkeys(paths))


def tables_of_columns(columns: Columns) -> list[GivenTable]:
    """Return the tables that the columns of one file form; columns of text are listed and excluded."""
    path = columns.path
    numeric = {name: np.asarray(x, float) for name, x in columns.values.items() if not isinstance(x, str)}
    for name, x in columns.values.items():
        about = read_name(name).quantity if isinstance(x, str) and TWO_READINGS in x else None
        if about not in (None, "counter", "state"):
            raise RecordingError(f'{path.name}: column "{name}": {x}')
    texts = tuple(name for name, x in columns.values.items() if isinstance(x, str))
    scalars = {name: f"{x[0]:.12g}" for name, x in numeric.items() if len(x) == 1}
    long = {name: x for name, x in numeric.items() if len(x) >= MIN_TABLE_ROWS}
    facts = {**scalars, **columns.facts}
    empty = GivenTable(
        path,
        {},
        units=stated_units(facts, long) | {str(name): unit for name, unit in columns.units.items()},
        # The header of a file of moments states the unit of angles that it does not hold.
        angle_unit=None if quantity_of_file(path) in ("torque", "force", "emg") else columns.angle_unit,
        facts=facts,
        personal=columns.personal,
        quantity=quantity_of_file(path),
        texts=texts,
    )
    keys = columns.recordings or _trial_keys(long)
    if keys:
        return [
            replace(empty, columns=_without_fillers(part), key=key, facts=_facts_of(facts, key, keys))
            for key in keys
            for part in _by_length(_below(long, key)).values()
            if len(part) > 1 or len(keys) == 1
        ]
    parts = _parts(long, has_sheets=path.suffix.lower() in SHEET_ENDINGS)
    return [replace(empty, columns=_without_fillers(part), key=key) for key, part in parts]


def _without_fillers(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return a table's columns without packets that were filled with zeros, as a study reads them.

    Numbers beyond `MAX_READ_NUMBER`, infinite ones among them, are missing ones.
    """
    zeroed = zeroed_rows(columns)
    columns = {name: x[~zeroed] for name, x in columns.items()} if zeroed.any() else columns
    return {name: _without_huge(x) for name, x in columns.items()}


def _without_huge(values: np.ndarray) -> np.ndarray:
    """Return a column with NaN instead of numbers beyond `MAX_READ_NUMBER`."""
    huge = np.abs(values) > MAX_READ_NUMBER
    return np.where(huge, np.nan, values) if huge.any() else values


def _below(values: Mapping[str, np.ndarray], key: str) -> dict[str, np.ndarray]:
    """Return the columns whose names begin with a key."""
    return {name: x for name, x in values.items() if name.startswith(f"{key}.")}


def _facts_of(facts: Mapping[str, str], key: str, keys: Sequence[str]) -> dict[str, str]:
    """Return the settings of a recording in a file with several, and those of the whole file."""
    own = {name.removeprefix(f"{key}."): text for name, text in facts.items() if name.startswith(f"{key}.")}
    shared = {n: text for n, text in facts.items() if not n.startswith(tuple(f"{other}." for other in keys))}
    return {**shared, **own}


def _trial_keys(columns: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Return the beginnings of names that are trials: a word for one with its number, alike columns, a clock in each.

    Without such a word, groups that differ in a number may as well be joints or sensors of one recording.
    """
    keys: dict[str, None] = {}
    for name in columns:
        parts = name.split(".")
        for i, part in enumerate(parts[:-1]):
            if _TRIAL_NAME.fullmatch(part):
                keys[".".join(parts[: i + 1])] = None
                break
    alike = {tuple(name.removeprefix(f"{key}.") for name in _below(columns, key)) for key in keys}
    if len(keys) < 2 or len(alike) != 1 or not all(any(map(_is_rising, _below(columns, k).values())) for k in keys):
        return ()
    return tuple(keys)


def _parts(columns: Mapping[str, np.ndarray], *, has_sheets: bool) -> list[tuple[str, dict[str, np.ndarray]]]:
    """Return the tables of a file: columns of one length, by sheets or cells if several are alike."""
    if not columns:
        return []
    groups: dict[str, dict[str, np.ndarray]] = {}
    for name, x in columns.items():
        groups.setdefault(name.rpartition(".")[0], {})[name] = x
    children = {key: tuple(name.rpartition(".")[2] for name in part) for key, part in groups.items()}
    alike: dict[tuple[str, ...], list[str]] = {}
    for key, names in children.items():
        # The clocks of a file with several rates have one name, and are no tables.
        if key and not (len(names) == 1 and _is_rising(next(iter(groups[key].values())))):
            alike.setdefault(names, []).append(key)
    repeated = max(alike.values(), key=len, default=[])
    if 2 * sum(f"{name}.time" in columns for name in columns) >= len(columns):
        repeated = []  # each signal beside times of its own: one recording, whatever points are in its names
    lengths = {key: {len(x) for x in groups[key].values()} for key in repeated}
    apart = len({tuple(found) for found in lengths.values()}) > 1
    unnamed = all(name.rpartition(".")[2].isdigit() for key in repeated for name in groups[key])
    # Sheets without headers are tables of their own; matrices of a MAT file are columns of one.
    if len(repeated) >= 2 and (apart or (has_sheets and unnamed)):
        kept = [key for key in groups if key in repeated or len(groups) <= 12]
        return [(key, part) for key in kept for part in _by_length(groups[key]).values()]
    by_length = _by_length(columns)
    # The table is the one with the most numbers; short arrays beside it are results and settings.
    best = max(by_length.items(), key=lambda item: item[0] * min(len(item[1]), 6))
    others = [
        part for n, part in by_length.items()
        if n != best[0] and n > 0.02 * best[0] and len(part) >= 2 and any(_is_rising(x) for x in part.values())
    ]  # fmt: skip
    return [("", best[1]), *(("", part) for part in others)]


def _by_length(columns: Mapping[str, np.ndarray]) -> dict[int, dict[str, np.ndarray]]:
    """Return the columns of each length."""
    found: dict[int, dict[str, np.ndarray]] = {}
    for name, x in columns.items():
        found.setdefault(len(x), {})[name] = x
    return found


def _is_rising(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return len(known) > 2 and bool(np.all(np.diff(known) > 0.0))


def quantity_of_file(path: Path) -> str | None:
    """Return the quantity that a file's name, or its folder's, says of all its columns; None if it says none or
    several."""
    for text in (path.stem, path.parent.name):
        # "ID 7" is a person or a device, and a folder's long name tells a study.
        words = words_of(re.sub(r"(?<![A-Za-z])ID[ _-]*\d+", "", text, flags=re.IGNORECASE))
        if text == path.parent.name and len(words) > 2:
            continue
        joined = "".join(words)
        if "momentarm" in joined:
            return "moment_arm"
        if "emg" in joined:
            return "emg"
        found = [
            QUANTITY_BY_FILE_WORD[word]
            for word in words
            if word in QUANTITY_BY_FILE_WORD and (len(word) >= 2 or word == text.casefold())
        ]
        if len(set(found)) == 1:
            return found[0]
    return None


def _split_flat_files(tables: Sequence[GivenTable]) -> list[GivenTable]:
    """Return the tables, with files of one column each that belong together as tables of their columns."""
    flat = [t for t in tables if len(t.columns) == 1 and not t.key]
    by_folder: dict[tuple[Path, str], list[GivenTable]] = {}
    for table in flat:
        by_folder.setdefault((table.path.parent, _trial_of_flat(table.path)), []).append(table)
    made = [t for t in tables if t not in flat]
    for group in by_folder.values():
        rows = common_rows({t.path.name: t.rows for t in group}) if len(group) > 1 else None
        for table in group:
            ((name, values),) = table.columns.items()
            counts = (table.rows // rows,) if rows and table.rows > rows else ()
            shape = FlatShape(1, "single")
            if counts or rows is None or all(t.rows == rows for t in group):
                shape = find_flat_shape(values, counts)
            if shape.count == 1:
                made.append(table)
                continue
            columns = {f"{name}#{i}": part for i, part in enumerate(shape.split(values))}
            places = {f"{name}#{i}": (shape.order, i, shape.count) for i in range(shape.count)}
            made.append(GivenTable(
                table.path, columns, "", {}, table.angle_unit, table.facts, table.personal, table.quantity, places,
            ))  # fmt: skip
    return made


def _trial_of_flat(path: Path) -> str:
    """Return the part of a flat file's name that does not say its quantity."""
    return "_".join(word for word in words_of(path.stem) if not _is_quantity_word(word))


def _is_quantity_word(word: str) -> bool:
    return word in QUANTITY_BY_FILE_WORD or word in ("moment", "arm")


def trial_key(path: Path) -> str:
    """Return the words of a file's name that do not say a quantity, which files of one trial share."""
    stem = re.sub(r"[_ -]?MomentArm.*$", "", path.stem)
    return "_".join(w for w in words_of(stem) if not _is_quantity_word(w) and w not in _FILE_WORDS)


_FILE_WORDS = frozenset({"data", "read", "filt", "filtered", "raw", "log", "recording", "file", "out", "output", "imu"})
"""Words of files' names that tell no trial."""
