"""What an instrument stored: a table of whole numbers, as a file, or as the recording that reads it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .._atomic import write_text_atomically
from ..recordings.recording import Channel, Recording

Column = tuple[str, str, str, float]
"""Channel, its SI unit, its column's name, and SI value per stored count."""

Tables = Mapping[str, tuple[np.ndarray, list[Column]]]
"""What was stored of a trial, by file: ``"main"``, and other instruments' by the stream's name."""


def emg_table(time: np.ndarray, counts: np.ndarray, emg: Mapping) -> tuple[np.ndarray, list[Column]]:
    """Raw EMG as it is stored.

    Parameters
    ----------
    time : ndarray, shape (n,)
        [s]
    counts : ndarray, shape (n, muscles)
        In quanta.
    emg : mapping
        A rig's table of that name.

    Returns
    -------
    table : ndarray, shape (n, 1 + muscles)
    columns : list of Column
    """
    columns = [("time", "s", "sample", 1.0 / emg["rate"])]
    columns += [(f"emg.{muscle}", "V", muscle, emg["quantum"]) for muscle in emg["muscles"]]
    return np.column_stack([np.round(time * emg["rate"]), counts]), columns


def write_tables(folder: Path, name: str, tables: Tables) -> None:
    """Write a trial's files.

    Parameters
    ----------
    folder : Path
        The study's.
    name : str
        Of the trial.
    tables : Tables
    """
    for stream, (table, columns) in tables.items():
        # Whole numbers but for a first column of times to 0.1 ms; formatted in one go, a row of text then costs 1 us.
        whole = bool(np.all(table[:, 0] == np.round(table[:, 0])))
        row = ",".join(["%d" if whole else "%.4f", *["%d"] * (table.shape[1] - 1)])
        heads = ",".join(column for _, _, column, _ in columns)
        text = heads + "\n" + (f"{row}\n" * len(table)) % tuple(table.ravel().tolist())
        write_text_atomically(folder / "recordings" / _file(name, stream), text)


def tables_recording(name: str, use: str, protocol: str, participant: str | None, tables: Tables) -> Recording:
    """A recording as reading a trial's files would give it, without files.

    Parameters
    ----------
    name, use, protocol : str
    participant : str or None
    tables : Tables

    Returns
    -------
    Recording
    """

    def read(stream: str, title: str, streams: Mapping[str, Recording]) -> Recording:
        table, columns = tables[stream]
        channels = {
            channel: Channel(channel, scale * table[:, i], unit, column)
            for i, (channel, unit, column, scale) in enumerate(columns)
        }
        digest = hashlib.sha256(np.ascontiguousarray(table).tobytes()).hexdigest()
        path = Path(_file(name, stream))
        return Recording(title, path, digest, use, channels, protocol, participant, streams=streams)

    return read("main", name, {s: read(s, f"{name}.{s}", {}) for s in tables if s != "main"})


def _file(name: str, stream: str) -> str:
    return f"{name}.csv" if stream == "main" else f"{name}_{stream}.csv"
