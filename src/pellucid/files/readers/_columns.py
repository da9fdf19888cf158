"""The result of every reader: the numbers of a file, under the file's own names."""

from __future__ import annotations

import re
from collections.abc import Iterator, KeysView, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..._errors import RecordingError
from ..._tabular import data_frame
from ..personal_fields import PersonalField

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False)
class Columns:
    """The numeric content of one file, in the file's own units, as a mapping of columns by name.

    ``columns["name"]`` or ``columns[0]`` is a column. ``in``, ``len``, iteration and ``dict(columns)`` work as with a
    dictionary; `values` is an attribute here, not a method.

    Attributes
    ----------
    path : Path
        The file.
    values : Mapping[str, ndarray or str]
        In the file's order, each shape (n,) float64; a scalar has n = 1. A field of a structure is named by its dotted
        path. A column that holds text is a str instead, which says which text was found in which line.
    angle_unit : str or None
        ``"deg"`` or ``"rad"``, if the file states the unit of its angles.
    units : Mapping[str, str]
        Unit of each column for which the file states one.
    facts : Mapping[str, str]
        Values of labelled lines above a text table, such as a sampling rate, without personal ones.
    personal : tuple of PersonalField
        Fields that identify the recorded person; their values are excluded.
    recordings : tuple of str
        Of a file with several recordings, such as demonstrations or episodes, the beginning that the names of each
        one's columns share, without the dot behind it; () for a file with one.
    lost : str
        What the file lacks at its end because its writer was stopped, such as an incomplete last row; ``""`` for a
        whole file. `values` hold everything before it.
    damaged : str
        Rows that were excluded because they do not have the columns of the others; ``""`` if there are none.
    """

    path: Path
    values: Mapping[str, np.ndarray | str]
    angle_unit: str | None = None
    units: Mapping[str | int, str] = field(default_factory=dict)
    facts: Mapping[str, str] = field(default_factory=dict)
    personal: tuple[PersonalField, ...] = ()
    recordings: tuple[str, ...] = ()
    lost: str = ""
    damaged: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, as in the file."""
        return tuple(self.values)

    def __getitem__(self, name: str | int) -> np.ndarray:
        return self.column(name, str(name))

    def __contains__(self, name: object) -> bool:
        """Whether ``columns[name]`` finds a column, which may hold text."""
        if isinstance(name, int):
            return 0 <= name < len(self.values)
        return isinstance(name, str) and self._found_name(name) is not None

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    def keys(self) -> KeysView[str]:
        """Return the names of the columns, as in the file."""
        return self.values.keys()

    def to_frame(self) -> pandas.DataFrame:
        """Return the numeric columns as a data frame.

        Shorter columns end in NaN, so that streams of different lengths fit into one table. Columns of text are
        excluded.

        Raises
        ------
        PellucidError
            If pandas is not installed.
        """
        numeric = {name: x for name, x in self.values.items() if not isinstance(x, str)}
        longest = max(map(len, numeric.values()), default=0)
        padded = {name: np.pad(x, (0, longest - len(x)), constant_values=np.nan) for name, x in numeric.items()}
        return data_frame(padded)

    def __str__(self) -> str:
        contents = [
            (name, f"text: {x}" if isinstance(x, str) else f"{len(x)} samples {self.units.get(name, '')}".rstrip())
            for name, x in self.values.items()
        ]
        width = max(len(name) for name, _ in contents) if contents else 0
        head = f"{self.path.name}{f': truncated, found {self.lost}' if self.lost else ''}"
        head += f": left out {self.damaged}" if self.damaged else ""
        return "\n".join((head, *(f"  {name.ljust(width)}  {content}" for name, content in contents)))

    def column(self, key: str | int, channel: str) -> np.ndarray:
        """Return a column by its name or 0-based number; a message about it names `channel`.

        A unit in the header does not belong to the name: ``"t"`` finds the column ``"t [s]"`` or ``"t,s"``.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        RecordingError
            If the file has no such column, or text in it. The message names the existing columns and the nearest one.
        """
        names = list(self.values)
        if isinstance(key, int):
            if not 0 <= key < len(names):
                raise RecordingError(
                    f"{self.path.name}: channel {channel} asks for column number {key}, expected 0 to {len(names) - 1}"
                )
            return self._numbers(names[key], channel)
        found = self._found_name(key)
        if found is None:
            raise RecordingError(self._absence_message(key, channel, names))
        return self._numbers(found, channel)

    def _found_name(self, key: str) -> str | None:
        """Return the name of the column that `key` stands for, with or without a unit; None if it is not one."""
        if key in self.values:
            return key
        plain = _without_unit(key)
        same = [name for name in self.values if _without_unit(name) == plain]
        return same[0] if len(same) == 1 else None

    def _numbers(self, name: str, channel: str) -> np.ndarray:
        found = self.values[name]
        if isinstance(found, str):
            raise RecordingError(f'{self.path.name}: channel {channel}, column "{name}": {found}')
        return found

    def _absence_message(self, key: str, channel: str, names: list[str]) -> str:
        import difflib

        folded = [name for name in names if name.casefold() == key.casefold()]
        close = folded or difflib.get_close_matches(key, names, 1, 0.4)
        shown = ", ".join(names[:40]) + (", ..." if len(names) > 40 else "")
        return f'{self.path.name}: channel {channel} expects a column "{key}", found {shown or "none"}' + (
            f'; the nearest is "{close[0]}"' if close else ""
        )


def _without_unit(name: str) -> str:
    return re.sub(r"\s*(?:[\[(][^\])]*[\])]|,\s*[\w%°µ/^*]{1,8})\s*$", "", name).strip()
