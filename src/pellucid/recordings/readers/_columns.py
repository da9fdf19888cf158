"""What every reader gives back: the numbers of a file under the names the file has for them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..._errors import RecordingError


@dataclass(frozen=True, eq=False)
class Columns:
    """The numeric content of one file, before any unit is known.

    Attributes
    ----------
    path : Path
        The file.
    values : Mapping[str, ndarray or str]
        In the file's order, each shape (n,) float64; a scalar has n = 1. A field of a structure is named by its dotted
        path. A column of text holds instead, as a str, what was found where.
    angle_unit : str or None
        ``"deg"`` or ``"rad"``, where the file says in which its angles are.
    units : Mapping[str, str]
        By column, where the file says it of each.
    """

    path: Path
    values: Mapping[str, np.ndarray | str]
    angle_unit: str | None = None
    units: Mapping[str | int, str] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns, as the file has them."""
        return tuple(self.values)

    def __getitem__(self, name: str | int) -> np.ndarray:
        return self.column(name, str(name))

    def __str__(self) -> str:
        told = [
            (name, f"text: {x}" if isinstance(x, str) else f"{len(x)} samples {self.units.get(name, '')}".rstrip())
            for name, x in self.values.items()
        ]
        wide = max(len(name) for name, _ in told) if told else 0
        return "\n".join((self.path.name, *(f"  {name.ljust(wide)}  {what}" for name, what in told)))

    def column(self, key: str | int, channel: str) -> np.ndarray:
        """Column by its name or 0-based number, for `channel` (named in the message).

        A unit in a header is no part of the name: ``"t"`` finds the column ``"t [s]"``.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        RecordingError
            If the file has no such column, or text in it; names the columns it has, and the nearest.
        """
        names = list(self.values)
        if isinstance(key, int):
            if not 0 <= key < len(names):
                raise RecordingError(
                    f"{self.path.name}: channel {channel} asks for column number {key}, expected 0 to {len(names) - 1}"
                )
            return self._numbers(names[key], channel)
        if key in names:
            return self._numbers(key, channel)
        same = [name for name in names if _bare(name) == _bare(key)]
        if len(same) == 1:
            return self._numbers(same[0], channel)
        raise RecordingError(self._absent(key, channel, names))

    def _numbers(self, name: str, channel: str) -> np.ndarray:
        found = self.values[name]
        if isinstance(found, str):
            raise RecordingError(f'{self.path.name}: channel {channel}, column "{name}": {found}')
        return found

    def _absent(self, key: str, channel: str, names: list[str]) -> str:
        import difflib

        folded = [name for name in names if name.casefold() == key.casefold()]
        close = folded or difflib.get_close_matches(key, names, 1, 0.4)
        shown = ", ".join(names[:40]) + (", ..." if len(names) > 40 else "")
        return f'{self.path.name}: channel {channel} expects a column "{key}", found {shown or "none"}' + (
            f'; the nearest is "{close[0]}"' if close else ""
        )


def _bare(name: str) -> str:
    return re.sub(r"\s*[\[(][^\])]*[\])]\s*$", "", name).strip()
