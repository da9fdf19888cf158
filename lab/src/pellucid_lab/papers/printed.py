"""What a paper prints, as typed data: each number with its unit, its digits, and where it stands.

Each paper's folder has one ``printed.toml``. Numbers are read digit for digit, because a number that is rounded to
three decimals stands for an interval, and what can be recomputed from it does too: `Printed.interval`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from pellucid._errors import PellucidError
from pellucid._plugins import load_plugins, require_attributes


@dataclass(frozen=True)
class Printed:
    """A number as printed."""

    value: float  # Printed value, in `unit`
    half_unit: float  # Half a unit of the last digit printed: how far rounding may have moved it
    unit: str  # As the paper prints it, in this package's spelling
    where: str  # Table, equation or section

    @property
    def interval(self) -> tuple[float, float]:
        """What the number was before it was rounded lies between these, in `unit`."""
        return self.value - self.half_unit, self.value + self.half_unit

    def agrees(self, exact: float) -> bool:
        """Return whether `exact`, in `unit`, rounds to the printed number."""
        low, high = self.interval
        slack = 1e-9 * self.half_unit  # a value that lies on the edge may round either way
        return low - slack <= exact <= high + slack


@dataclass(frozen=True)
class PrintedTable:
    """A table; a cell the paper leaves empty is not there."""

    where: str  # The table's number
    rows: Mapping[str, Mapping[str, Printed]]  # Row, then column
    # What rows are called for readers, for those that are called otherwise
    labels: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, row: str) -> Mapping[str, Printed]:
        return self.rows[row]


@dataclass(frozen=True)
class PrintedPaper:
    """All the numbers of a paper that Pellucid uses."""

    name: str
    title: str
    authors: str
    journal: str
    year: int
    # Numbers in the text and in equations; several where the paper lists several
    values: Mapping[str, Printed | tuple[Printed, ...]]
    tables: Mapping[str, PrintedTable]
    doi: str = ""  # Digital object identifier; "" where there is none, or none is known

    @property
    def citation(self) -> str:
        """Authors, year, title, journal and DOI."""
        doi = f", doi:{self.doi}" if self.doi else ""
        authors = "Author not named" if self.authors == "not named" else self.authors
        return f"{authors} ({self.year}): {self.title}, {self.journal}{doi}"

    def __getitem__(self, name: str) -> float:
        """Return a single number of `values`, without the rest."""
        found = self.values[name]
        if isinstance(found, tuple):
            raise KeyError(f"{name!r} is a list of {len(found)} numbers; take it from values")
        return found.value


class PaperFolder(NamedTuple):
    """The folder of a paper, and the package that holds it."""

    package: ModuleType
    path: Path


def papers() -> dict[str, PaperFolder]:
    """Return the folder of every paper, by name.

    Packages are entry points of ``pellucid.papers``; a folder is a paper's if it has a ``printed.toml``.
    """
    found: dict[str, PaperFolder] = {}
    for plugin in load_plugins("pellucid.papers"):
        require_attributes(plugin, "pellucid.papers", "__path__")
        for place in plugin.value.__path__:
            for toml in Path(place).glob("*/printed.toml"):
                found.setdefault(toml.parent.name, PaperFolder(plugin.value, toml.parent))
    return dict(sorted(found.items()))


def printed(paper: str) -> PrintedPaper:
    """Return the numbers that a paper, one of `papers`, prints."""
    folder = papers().get(paper)
    if folder is None:
        raise PellucidError(f"unknown paper {paper!r}; known: {', '.join(papers())}")
    raw = tomllib.loads((folder.path / "printed.toml").read_text(encoding="utf-8"), parse_float=Decimal)
    values = {name: _value(entry) for name, entry in raw.get("values", {}).items()}
    tables = {name: _table(entry) for name, entry in raw.get("tables", {}).items()}
    about = {key: raw[key] for key in ("name", "title", "authors", "journal", "year")}
    return PrintedPaper(**about, values=values, tables=tables, doi=str(raw.get("doi", "")))


def _value(entry: Mapping) -> Printed | tuple[Printed, ...]:
    if isinstance(entry["value"], list):
        return tuple(_number(v, entry["unit"], entry["where"]) for v in entry["value"])
    return _number(entry["value"], entry["unit"], entry["where"])


def _table(entry: Mapping) -> PrintedTable:
    where, units = entry["where"], entry["units"]
    rows = {
        row: {column: _number(cell, units[column], where) for column, cell in cells.items()}
        for row, cells in entry["rows"].items()
    }
    return PrintedTable(where, rows, dict(entry.get("labels", {})))


def _number(value: Decimal | int, unit: str, where: str) -> Printed:
    exponent = value.as_tuple().exponent if isinstance(value, Decimal) else 0
    return Printed(float(value), 0.5 * 10.0**exponent, unit, where)
