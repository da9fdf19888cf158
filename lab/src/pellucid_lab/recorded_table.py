"""Tables as an instrument stores them: the numbers of one file, and the meaning of its columns."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pellucid import _core

from .shared_tables import EmgTable

MAIN_STREAM = "main"
"""Name of the stream of the machine's own file, which every recording has."""

MARKER_STREAM = "markers"
"""Name of the stream of the motion capture's file."""

COUNT_TEXT = "%d"
"""Format of a whole number."""

PART_ROW_COUNT = 1 << 14
"""Number of rows whose text is made at a time, so that the text of a file is never in memory as a whole."""

FIXED_TEXT = re.compile(r"%(?:d|\.(\d{1,2})f)")
"""Formats of whole numbers, and of numbers with so many decimals, which the core writes."""


@dataclass(frozen=True)
class Column:
    """One column of a file, and the channel that study.toml makes of it."""

    channel: str  # name of the channel in study.toml
    name: str  # name of the column in the file
    unit: str  # unit of the stored numbers times `scale`
    scale: float = 1.0  # `unit` per stored number
    text: str = COUNT_TEXT  # format of a number, for the % operator

    @property
    def spec(self) -> dict[str, str | float]:
        """Return the column's entry in the table ``[channels]`` of study.toml."""
        scale = {} if self.scale == 1.0 else {"scale": self.scale}
        return {"column": self.name, "unit": self.unit, **scale}


@dataclass(frozen=True, eq=False)
class StoredTable:
    """The numbers of one file as an instrument wrote them."""

    columns: tuple[Column, ...]
    values: np.ndarray  # (n, columns) counts, or numbers in the columns' units; NaN where a sample is missing
    comment: str = ""  # text before the header line, with its line end; "" for none
    released_duration: float = float("nan")  # duration of the rows that an emptied table had [s]

    @classmethod
    def of(cls, columns: Sequence[Column], *values: np.ndarray, comment: str = "") -> StoredTable:
        """Make a table of `values`, arrays of shape (n,) or (n, k) that fill the `columns` from left to right."""
        return cls(tuple(columns), np.column_stack(values), comment)

    @property
    def text(self) -> str:
        """Return the text of the CSV file."""
        return b"".join(self.parts).decode("utf-8")

    @property
    def parts(self) -> Iterator[bytes]:
        """Yield the text of the CSV file, `PART_ROW_COUNT` rows at a time. A missing sample is an empty cell."""
        heads = ",".join(column.name for column in self.columns)
        yield f"{self.comment}{heads}\n".encode()
        formats = [FIXED_TEXT.fullmatch(column.text) for column in self.columns]
        decimals = np.array([int(found[1] or 0) for found in formats if found])
        whole = decimals == 0
        row = ",".join(column.text for column in self.columns) + "\n"
        for first in range(0, len(self.values), PART_ROW_COUNT):
            values = self.values[first : first + PART_ROW_COUNT]
            if all(formats):
                values = np.where(whole, np.trunc(values), values) if whole.any() else values
                yield _core.number_rows(values, decimals)
                continue
            body = (row * len(values)) % tuple(values.ravel().tolist())
            yield (body.replace("nan", "") if np.isnan(values).any() else body).encode()

    @property
    def digest(self) -> str:
        """Return the SHA-256 of the numbers, hexadecimal."""
        return hashlib.sha256(np.ascontiguousarray(self.values).tobytes()).hexdigest()

    def column(self, name: str) -> np.ndarray:
        """Return the numbers of the column `name`, shape (n,), before the rounding of the file's text."""
        return self.values[:, [column.name for column in self.columns].index(name)]

    @property
    def duration(self) -> float:
        """Return the duration of the recording by the clock in the first column [s]."""
        if not len(self.values):
            return self.released_duration
        clock = self.columns[0]
        time = clock.scale * self.values[[0, -1], 0] * (1e-3 if clock.unit == "ms" else 1.0)
        return float(time[-1] - time[0]) * len(self.values) / (len(self.values) - 1)

    @property
    def emptied(self) -> StoredTable:
        """Return a table with the same columns and duration, and no row."""
        # A view would keep all samples alive.
        return StoredTable(self.columns, self.values[:0].copy(), released_duration=self.duration)


def file_name(recording: str, stream: str) -> str:
    """Return the path of the file of a stream of a recording, relative to the study's folder."""
    return f"recordings/{recording}.csv" if stream == MAIN_STREAM else f"recordings/{recording}_{stream}.csv"


def emg_columns(emg: EmgTable) -> tuple[Column, ...]:
    """Return the columns of raw EMG in counts of the converter, from a rig's table ``[emg]``."""
    clock = Column("time", "sample", "s", 1.0 / emg.rate)
    return (clock, *(Column(f"emg.{muscle}", muscle, "V", emg.quantum) for muscle in emg.muscles))


def store_emg(time: np.ndarray, counts: np.ndarray, emg: EmgTable) -> StoredTable:
    """Return raw EMG as stored: `time` (n,) [s], the converter's `counts` (n, muscles); `emg` is a rig's table."""
    return StoredTable.of(emg_columns(emg), np.round(time * emg.rate), counts)


def marker_columns(markers: Sequence[str]) -> tuple[Column, ...]:
    """Return the columns of a motion capture's file: its own clock [s], and three coordinates [mm] of each marker."""
    clock = Column("time", "time", "s", text="%.5f")
    return (clock, *(Column(f"{m}.{axis}", f"{m}_{axis}", "mm", text="%.1f") for m in markers for axis in "xyz"))
