"""Read text that Delsys's EMGworks and Trigno Discover export: each signal with its own times.

A signal keeps its name, and its times are the column NAME.time. EMGworks names the times of every signal ``X[s]``
below a line for each signal that begins with ``Label:``; Trigno Discover names them ``NAME Time Series (s)``. Slower
signals end earlier, in empty cells. The maker does not publish the layouts; these are the ones that public scripts
read.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from ..._errors import RecordingError
from ..stated_units import unit_from_text
from ._caps import require_few_columns, require_unpacked_size
from ._columns import Columns
from ._last_row import cut_row

ENDINGS = (".csv", ".txt")

MAX_HEADER_BYTES = 1 << 20
"""The header is searched among this many bytes; EMGworks writes a line for each signal above it."""

_TIME_MARKS = ("X[s]", "X [s]", "Time Series (s)")
_TIME_NAME_PATTERN = re.compile(r"X ?\[s\]|.*Time Series \(s\)")
_VOLT_PATTERN = re.compile(r"[\[(]([muµμ]?V)[\])]\s*$")
_LABEL_PATTERN = re.compile(r"Label:\s*(.*?)\s+Sampling frequency:.*?\bUnit:\s*(\S*)")


def recognises(path: Path) -> bool:
    """Whether a file's first lines hold a header in which every second column, from the first, is a time."""
    with path.open("rb") as file:
        head = file.read(MAX_HEADER_BYTES)
    # Single letters are found fastest, and each of the marks ends in one of two.
    if b"]" not in head and b")" not in head:
        return False
    text = head.decode("latin-1")
    return any(mark in text for mark in _TIME_MARKS) and _find_header(text.splitlines()) is not None


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) with the n of its signal."""
    raw, cut = path.read_bytes(), cut_row(path)
    text = (raw if cut is None else raw[: cut.start]).decode("utf-8-sig", "replace")
    lines = text.splitlines()
    found = _find_header(lines)
    if found is None:
        raise RecordingError(f"{path.name}: not readable as an export of Delsys: found no header with times")
    at, names, delimiter = found
    require_few_columns(path, len(names))
    stated = {match[1]: match[2] for line in lines[:at] if (match := _LABEL_PATTERN.match(line.strip()))}
    rows = [row for row in csv.reader(lines[at + 1 :], delimiter=delimiter) if any(cell.strip() for cell in row)]
    require_unpacked_size(path, float(len(rows)) * len(names))
    values: dict[str, np.ndarray | str] = {}
    units: dict[str | int, str] = {}
    for i in range(0, len(names), 2):
        name = names[i + 1]
        if name in values:
            raise RecordingError(f'{path.name}: found two signals named "{name}", expected each once')
        times, samples = (_column(path, rows, at + 2, place) for place in (i, i + 1))
        n = _length(times, samples)
        values[f"{name}.time"], values[name] = times[:n], samples[:n]
        units[f"{name}.time"] = "s"
        # Units of other signals are spelt in ways that mean something else to others, such as G.
        unit = _VOLT_PATTERN.search(name) or _VOLT_PATTERN.search(f"[{stated.get(name, '')}]")
        if unit:
            units[name] = unit_from_text(unit[1]) or unit[1]
    return Columns(path, _with_lost_ends(values), units=units)


MAX_LOST_SHARE = 0.2
"""A signal that ends earlier by at most this share of the longest one of its rate lost packets, and keeps the clock."""


def _with_lost_ends(values: dict[str, np.ndarray | str]) -> dict[str, np.ndarray | str]:
    """Return signals of one rate with one clock: those that end earlier are missing (NaN) from there on."""
    clocks = {n.removesuffix(".time"): np.asarray(t) for n, t in values.items() if n.endswith(".time") and len(t) > 2}
    steps = {name: float(np.median(np.diff(t))) for name, t in clocks.items()}
    made = dict(values)
    for name, own in clocks.items():
        step = steps[name]
        alike = [t for n, t in clocks.items() if abs(steps[n] - step) < 1e-3 * step and t[0] == own[0]]
        longest = max(alike, key=len, default=own)
        missing = len(longest) - len(own)
        if 0 < missing <= MAX_LOST_SHARE * len(longest) and np.allclose(own, longest[: len(own)], atol=0.5 * step):
            made[f"{name}.time"] = longest
            made[name] = np.concatenate([values[name], np.full(missing, np.nan)])
    return made


def _find_header(lines: list[str]) -> tuple[int, list[str], str] | None:
    """Return the number of the header's line, from 0, its names and its delimiter; None without such a line."""
    for number, line in enumerate(lines):
        if not any(mark in line for mark in _TIME_MARKS):
            continue
        for delimiter in (",", "\t", ";"):
            names = [name.strip() for name in next(csv.reader([line], delimiter=delimiter))]
            while names and not names[-1]:
                names.pop()
            if len(names) > 1 and len(names) % 2 == 0 and all(map(_TIME_NAME_PATTERN.fullmatch, names[::2])):
                return number, names, delimiter
    return None


def _column(path: Path, rows: list[list[str]], first: int, place: int) -> np.ndarray:
    """Return a column of cells, shape (rows,); an empty cell is NaN."""
    cells = [row[place].strip() if place < len(row) else "" for row in rows]
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        number, cell = next((i, cell) for i, cell in enumerate(cells, first) if cell and not _is_number(cell))
        raise RecordingError(
            f'{path.name}: row {number}, column {place + 1}: found the text "{cell[:40]}", expected a number'
        ) from None


def _length(times: np.ndarray, samples: np.ndarray) -> int:
    """Return the number of samples of a signal before it ends in empty cells."""
    filled = np.flatnonzero(np.isfinite(times) | np.isfinite(samples))
    n = int(filled[-1]) + 1 if filled.size else 0
    # EMGworks fills up a slower signal's cells with zeros, at the time 0.
    rising = np.flatnonzero(np.diff(times[:n]) < 0.0)
    return int(rising[0]) + 1 if rising.size and not times[rising[0] + 1 : n].any() else n


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
