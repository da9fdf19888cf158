"""Files to named columns, one module per format; nothing else in the package opens a data file."""

from __future__ import annotations

from ._columns import Columns as Columns
from .read import read_columns as read_columns
