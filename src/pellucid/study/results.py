"""Read and write results.json: every figure that the commands printed, with its unit and its data split."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from .._atomic import write_text_atomically
from .._errors import PellucidError, RecordingError
from .._given import read_given
from .kept import hold_lock

DATA_SPLITS = ("fitted", "heldout", "simulated")
"""Kinds of data that a figure may be computed on."""


@dataclass(frozen=True)
class ResultRow:
    """One figure of results.json."""

    id: str  # ``<study name>.<quantity>...``, unique in a file
    value: float | int | None  # value in `unit`; None if it could not be computed, with the reason in `note`
    unit: str  # unit as plain text; ``"1"`` for a dimensionless figure
    command: str  # command that wrote the row
    split: str  # data of the figure: ``"fitted"``, ``"heldout"`` or ``"simulated"``
    data_checksum: str | None = None  # SHA-256 of the data that it was computed from
    note: str = ""  # remark for the reader
    undetermined: bool = False  # whether the recordings do not determine it, so that another processor may differ

    def __post_init__(self):
        if not all(isinstance(text, str) for text in (self.id, self.command, self.note)):
            raise RecordingError(f"{str(self.id)[:100]}: found an id, a command or a note that is no text")
        if self.split not in DATA_SPLITS:
            raise RecordingError(f"{self.id}: found the split {self.split!r}, expected one of {', '.join(DATA_SPLITS)}")
        if not isinstance(self.unit, str) or not self.unit:
            raise RecordingError(f'{self.id}: found the unit {self.unit!r}, expected a text such as "N*m" or "1"')
        if self.value is None:
            return
        try:
            # JSON cannot store a NumPy scalar.
            number = self.value if type(self.value) in (int, float) else float(self.value)
        except (TypeError, ValueError):
            raise RecordingError(f"{self.id}: found the value {self.value!r}, expected a number or None") from None
        object.__setattr__(self, "value", number)


def combined_checksum(checksums: Iterable[str]) -> str:
    """Return the SHA-256 of several recordings' checksums in any order, for a figure that is computed from all."""
    return sha256("".join(sorted(checksums)).encode()).hexdigest()


def write_rows(path: str | os.PathLike, command: str, rows: Iterable[ResultRow]) -> tuple[ResultRow, ...]:
    """Replace the rows that a command wrote before by new ones, and return all rows.

    All other rows are kept, also those of a command that writes at the same time.
    """
    with hold_lock(path):
        return replace_rows(Path(path), command, rows)


def replace_rows(
    path: Path, command: str, rows: Iterable[ResultRow], answers: Sequence[dict[str, Any]] | None = None
) -> tuple[ResultRow, ...]:
    """Do what `write_rows` does, for a caller that holds the lock of `path`.

    `answers` of the command replace its earlier ones; without them these stay.
    """
    rows = tuple(finite_row(row) for row in rows)
    for row in rows:
        if row.command != command:
            raise RecordingError(f"{row.id}: found the command {row.command!r}, expected {command!r}")
    kept = tuple(row for row in read_rows(path) if row.command != command) if path.exists() else ()
    both = kept + rows
    seen: dict[str, str] = {}
    for row in both:
        if row.id in seen:
            raise RecordingError(
                f"{path}: the id {row.id} occurs twice, in rows of {seen[row.id]} and of {row.command}"
            )
        seen[row.id] = row.command
    said = read_answers(path) if path.exists() else []
    if answers is not None:
        said = [each for each in said if each.get("command") != command]
        said += [{"command": command, **each} for each in answers]
    content = {"figures": [row_table(row) for row in both], **({"answers": said} if said else {})}
    write_text_atomically(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return both


def read_answers(path: str | os.PathLike) -> list[dict[str, Any]]:
    """Return the answers of a results.json, a table of each with its command; empty if it has none."""
    content = _read_content(Path(path))
    found = content.get("answers") if isinstance(content, dict) else None
    return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []


def require_own_page(folder: Path, command: str) -> None:
    """Raise a PellucidError if a folder holds a page, but no results of `command`."""
    if not (folder / "index.html").exists():
        return
    path = folder / "results.json"
    found = sorted({row.command for row in read_rows(path)}) if path.is_file() else []
    if command not in found:
        raise PellucidError(
            f"{folder}: found index.html of {', '.join(found) or 'something else'}, expected none, or that of an "
            f"earlier '{command}'; name another folder with --out"
        )


def row_table(row: ResultRow) -> dict[str, Any]:
    """Return a row as a table for JSON; the key "undetermined" is omitted if it is False."""
    return {key: value for key, value in vars(row).items() if key != "undetermined" or value}


def read_rows(path: str | os.PathLike) -> list[ResultRow]:
    """Return the rows of a results.json, in its order."""
    path = Path(path)
    content = _read_content(path)
    figures = content.get("figures") if isinstance(content, dict) else None
    if not isinstance(figures, list):
        raise RecordingError(f'{path}: found no list "figures", expected one row for each figure')
    known = {each.name for each in fields(ResultRow)}
    rows = []
    for number, figure in enumerate(figures, 1):
        missing = {"id", "value", "unit", "command", "split"} - set(figure) if isinstance(figure, dict) else known
        if missing:
            raise RecordingError(f"{path}: figure {number} lacks {', '.join(sorted(missing))}")
        rows.append(ResultRow(**{key: figure[key] for key in known & set(figure)}))
    return rows


def _read_content(path: Path) -> Any:
    """Return what a results.json holds, as JSON."""
    try:
        return json.loads(read_given(path).decode("utf-8"))
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file; the commands write it") from None
    except (OSError, ValueError, RecursionError) as error:
        raise RecordingError(
            f"{path}: not readable as JSON, truncated or damaged: {error}; remove it and run the commands again"
        ) from error


def finite_row(row: ResultRow) -> ResultRow:
    """Return a row for a file: a value that is not finite becomes None, with a note."""
    if row.value is None or math.isfinite(row.value):
        return row
    return replace(row, value=None, note="; ".join(filter(None, [row.note, f"not finite: {row.value}"])))
