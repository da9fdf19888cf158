"""What an instrument stored: the numbers of one file as it wrote them, and what its columns mean."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

MAIN_STREAM, MARKER_STREAM = "main", "markers"
"""Streams that study.toml names by themselves: the machine's own file, and the motion capture's."""


@dataclass(frozen=True)
class Column:
    """One column of a file, and the channel that study.toml makes of it."""

    channel: str  # channel, name: The channel, and what the file calls the column
    name: str
    unit: str  # Of the stored numbers times `scale`
    scale: float = 1.0  # `unit` per stored number
    text: str = "%d"  # How a number is written, as the % operator takes it

    @property
    def spec(self) -> dict[str, str | float]:
        """Its entry of ``[channels]`` in study.toml."""
        scale = {} if self.scale == 1.0 else {"scale": self.scale}
        return {"column": self.name, "unit": self.unit, **scale}


@dataclass(frozen=True, eq=False)
class StoredTable:
    """One file's numbers as an instrument wrote them."""

    columns: tuple[Column, ...]
    values: np.ndarray  # (n, columns) Counts, or numbers in the columns' units; NaN where a sample is missing
    comment: str = ""  # First line of the file, if it has one before its header

    @classmethod
    def of(cls, columns: Sequence[Column], *values: np.ndarray, comment: str = "") -> StoredTable:
        """From one array, shape (n,) or (n, k), after another; as many `values` as fill the `columns`, a `comment`."""
        return cls(tuple(columns), np.column_stack(values), comment)

    @property
    def text(self) -> str:
        """The file."""
        # Formatted in one go, a row of text costs 1 us.
        row = ",".join(column.text for column in self.columns) + "\n"
        body = (row * len(self.values)) % tuple(self.values.ravel().tolist())
        if np.isnan(self.values).any():
            body = body.replace("nan", "")
        heads = ",".join(column.name for column in self.columns)
        return f"{self.comment}{heads}\n{body}"

    @property
    def digest(self) -> str:
        """SHA-256 of the numbers, hexadecimal."""
        return hashlib.sha256(np.ascontiguousarray(self.values).tobytes()).hexdigest()

    def column(self, name: str) -> np.ndarray:
        """The numbers of a column by its `name`, shape (n,); a file holds them to the digits of its text."""
        return self.values[:, [column.name for column in self.columns].index(name)]

    @property
    def emptied(self) -> StoredTable:
        """The same columns without a sample."""
        return StoredTable(self.columns, self.values[:0])


def file_name(recording: str, stream: str) -> str:
    """Where a stream of a recording is stored, from the study's folder."""
    return f"recordings/{recording}.csv" if stream == MAIN_STREAM else f"recordings/{recording}_{stream}.csv"


def emg_columns(emg: Mapping) -> tuple[Column, ...]:
    """Columns of raw EMG as the converter counts it, from a rig's table ``[emg]``."""
    clock = Column("time", "sample", "s", 1.0 / emg["rate"])
    return (clock, *(Column(f"emg.{muscle}", muscle, "V", emg["quantum"]) for muscle in emg["muscles"]))


def store_emg(time: np.ndarray, counts: np.ndarray, emg: Mapping) -> StoredTable:
    """Raw EMG as stored: `time` (n,) [s] and `counts` (n, muscles) of a converter that `emg`, a rig's table, tells."""
    return StoredTable.of(emg_columns(emg), np.round(time * emg["rate"]), counts)


def marker_columns(markers: Sequence[str]) -> tuple[Column, ...]:
    """Columns of a motion capture's file: its own clock, and three coordinates [mm] of each marker."""
    clock = Column("time", "time", "s", text="%.5f")
    return (clock, *(Column(f"{m}.{axis}", f"{m}_{axis}", "mm", text="%.1f") for m in markers for axis in "xyz"))
