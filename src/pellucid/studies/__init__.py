"""Studies: what study.toml says of recordings, how sound they are, and the results that are kept of them."""

from __future__ import annotations

from .quality import inspect as inspect
from .quality import require_sound as require_sound
from .results import ResultRow as ResultRow
from .results import read_rows as read_rows
from .results import write_rows as write_rows
from .study import Study as Study
from .study import drive_channel as drive_channel
