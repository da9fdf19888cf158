"""Read long tables of plain numbers with Arrow, block by block, in a fiftieth of the time and memory of Python.

The function accepts only unambiguous tables. It returns None for a row of another length, a word or a comment between
rows, so that the careful reader takes over.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ._last_row import FilePart

MIN_LONG_FILE_BYTES = 400_000
"""Files from this size on are read with Arrow. To load it takes as long as to read three such files without it."""

BLOCK_BYTES = 1 << 18
"""Arrow reads the file in blocks of this size."""

MISSING_WORDS = [
    word
    for base in ("nan", "na", "n/a", "null", "none", "missing")
    for word in (base, base.upper(), base.title(), base.capitalize())
] + ["", "-", "--", "NaN"]
"""Words that mean a missing sample, in the spellings that programs write."""


def number_table(
    path: Path, first: int, width: int, *, delimiter: str, decimal: str, end: int | None = None
) -> list[np.ndarray] | None:
    """Return `width` columns, shape (n,) each, from the rows between the bytes `first` and `end` of a file.

    The result is None if a row is not `width` numbers with the given `delimiter` and `decimal` mark, or if a column is
    empty throughout.
    """
    import pyarrow
    from pyarrow import csv

    names = [str(i) for i in range(width)]
    columns = [np.empty(0) for _ in names]
    size, filled = path.stat().st_size - first, 0
    try:
        with pyarrow.OSFile(str(path)) if end is None else pyarrow.PythonFile(FilePart(path, end), "r") as file:
            file.seek(first)
            blocks = csv.open_csv(
                file,
                csv.ReadOptions(use_threads=False, block_size=BLOCK_BYTES, column_names=names),
                csv.ParseOptions(delimiter=delimiter, quote_char=False),
                csv.ConvertOptions(
                    column_types=dict.fromkeys(names, pyarrow.float64()),
                    null_values=MISSING_WORDS,
                    decimal_point=decimal,
                    check_utf8=False,
                ),
                memory_pool=pyarrow.system_memory_pool(),
            )
            for block in blocks:
                n = block.num_rows
                if filled + n > len(columns[0]):
                    # Rows are similar in length, so that mostly one allocation is enough.
                    expected = filled + n if not filled else filled + n + filled // 4
                    expected = max(expected, int(1.02 * size * (filled + n) / max(file.tell() - first, 1)))
                    for column in columns:
                        column.resize(expected, refcheck=False)
                for column, read in zip(columns, block.columns, strict=True):
                    # Arrow's own way to NumPy loads pandas, which takes as long as to read 20 MB.
                    column[filled : filled + n] = np.from_dlpack(read.fill_null(np.nan) if read.null_count else read)
                filled += n
    except (pyarrow.ArrowInvalid, pyarrow.ArrowTypeError):
        return None
    for column in columns:
        column.resize(filled, refcheck=False)
    if not filled or any(np.isnan(column[0]) and np.isnan(column).all() for column in columns):
        return None
    return columns
