"""Read JSON files: an object of arrays, an array of objects, or both nested."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ..._errors import RecordingError
from ._columns import Columns
from ._flatten import flatten

ENDINGS = (".json",)


def read(path: Path) -> Columns:
    """Return the numeric leaves of a JSON file by dotted path, each shape (n,) float64; booleans are 0 and 1."""
    try:
        # Integers are read as floats, because JSON allows integers of any length.
        content = json.loads(path.read_text(encoding="utf-8-sig"), parse_int=float)
        into: dict[str, np.ndarray] = {}
        flatten(content, "", into, path)
    except RecordingError:
        raise
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{path.name}: not readable as JSON, truncated or damaged: {error}") from error
    return Columns(path, into)
