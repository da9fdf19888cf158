"""Read workbooks: the tables of all their sheets.

A column of a workbook with one table keeps its name. With several tables it is named by its sheet, ``EMG.biceps``.
A sheet is understood as a text table is: titles may stand above the header, columns without a header are numbered, and
stamps of a wall clock become seconds.
"""

from __future__ import annotations

import io
from collections import Counter
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ..personal_fields import PersonalField
from ._caps import require_few_columns, require_unpacked_size
from ._columns import Columns
from .csv import read_table

ENDINGS = (".xlsx", ".xlsm", ".ods")
APART = ("python_calamine",)


def read(path: Path) -> Columns:
    """Return columns by name, in the file's own units, each shape (n,) with the n of its sheet."""
    from python_calamine import CalamineWorkbook

    try:
        workbook = CalamineWorkbook.from_path(str(path))
        sheets = {name: workbook.get_sheet_by_name(name) for name in workbook.sheet_names}
        require_unpacked_size(path, sum(sheet.total_height * sheet.total_width for sheet in sheets.values()))
        tables = {name: _table(path, sheet.to_python(skip_empty_area=False)) for name, sheet in sheets.items()}
    except (RecordingError, MemoryError):
        raise
    except Exception as error:  # the library has errors of its own for damaged files
        raise RecordingError(f"{path.name}: not readable as a workbook, truncated or damaged: {error}") from error
    filled = {name: table for name, table in tables.items() if table is not None}
    values: dict[str, np.ndarray | str] = {}
    units: dict[str | int, str] = {}
    facts: dict[str, str] = {}
    personal: list[PersonalField] = []
    for sheet, table in filled.items():
        facts |= {label if len(filled) == 1 else f"{sheet}.{label}": text for label, text in table.facts.items()}
        personal += table.personal
        for name, column in table.values.items():
            own = name if len(filled) == 1 else f"{sheet}.{name}"
            values[own] = column
            if name in table.units:
                units[own] = table.units[name]
        require_few_columns(path, len(values))
    if not values:
        raise RecordingError(f"{path.name}: found no sheet with a row of numbers, expected one")
    damaged = "; ".join(table.damaged for table in filled.values() if table.damaged)
    return Columns(path, values, units=units, facts=facts, personal=tuple(personal), damaged=damaged)


MAX_EMPTY_COLUMNS = 5
"""At most so many columns at the end of a sheet may have a name and nothing below it, such as remarks."""


def _table(path: Path, cells: list[list[Any]]) -> Columns | None:
    """Return the columns of a sheet's cells; None if no row has a number."""
    if not any(isinstance(cell, (int, float)) and not isinstance(cell, bool) for row in cells for cell in row):
        return None
    texts = [[_cell_text(cell) for cell in row] for row in cells]
    widths = [max((i for i, text in enumerate(row, 1) if text), default=0) for row in texts]
    table_width = Counter(width for width in widths if width).most_common(1)[0][0]
    wider = [row[:width] for row, width in zip(texts, widths, strict=True) if width > table_width]
    if len(wider) == 1 and all(wider[0]) and len(wider[0]) - table_width <= MAX_EMPTY_COLUMNS:
        # Columns behind the table that have a name and no cell.
        texts = [row[:table_width] for row in texts]
        widths = [min(width, table_width) for width in widths]
    begun, lines = False, []
    for row, width in zip(texts, widths, strict=True):
        begun = begun or width >= table_width
        # A row of the table may end in empty cells; settings above it have as many cells as they fill.
        lines.append("\t".join(row[: max(width, table_width) if begun and width else width]))
    return read_table(path, io.BytesIO("\n".join(lines).encode()), delimiter="\t")


def _cell_text(cell: Any) -> str:
    """Return a cell's text, which reads back to the same number."""
    if isinstance(cell, datetime):
        return cell.isoformat(" ")
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    return repr(cell) if isinstance(cell, float) else " ".join(str(cell).split())
