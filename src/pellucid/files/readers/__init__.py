"""Readers that turn a data file into named columns, one module per format. Only this package opens data files."""

from __future__ import annotations

from ._columns import Columns as Columns
from .read import describes_files as describes_files
from .read import read as read
from .read import read_columns as read_columns
