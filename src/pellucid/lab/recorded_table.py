"""What an instrument stored: a table of whole numbers, as the text of a file, or as the recording that reads it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from ..recordings.recording import Channel

Column = tuple[str, str, str, float]
"""Channel, its SI unit, its column's name, and SI value per stored count."""


def table_text(table: np.ndarray, heads: Sequence[str]) -> str:
    """A table as CSV: whole numbers, a first column of times to 0.1 ms where it is not whole.

    Parameters
    ----------
    table : ndarray, shape (n, k)
    heads : sequence of str
        Names of the k columns.

    Returns
    -------
    str
        Formatted in one go, for a row of text then costs 1 us.
    """
    whole = bool(np.all(table[:, 0] == np.round(table[:, 0])))
    row = ",".join(["%d" if whole else "%.4f", *["%d"] * (table.shape[1] - 1)])
    return ",".join(heads) + "\n" + (f"{row}\n" * len(table)) % tuple(table.ravel().tolist())


def table_channels(table: np.ndarray, columns: Sequence[Column]) -> dict[str, Channel]:
    """A table's channels as a reader would give them.

    Parameters
    ----------
    table : ndarray, shape (n, k)
    columns : sequence of Column
        Of the k columns.

    Returns
    -------
    dict of str to Channel
    """
    return {
        channel: Channel(channel, scale * table[:, i], unit, column)
        for i, (channel, unit, column, scale) in enumerate(columns)
    }


def table_digest(table: np.ndarray) -> str:
    """SHA-256 of a table's numbers, hexadecimal."""
    return hashlib.sha256(np.ascontiguousarray(table).tobytes()).hexdigest()
