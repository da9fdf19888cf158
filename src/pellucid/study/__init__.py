"""Studies: what study.toml says of recordings, how sound they are, and the results that are kept of them.

Each name below is imported when it is first used, so that a command that needs none of them does not wait for them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .quality import inspect as inspect
    from .quality import require_sound as require_sound
    from .results import ResultRow as ResultRow
    from .results import read_rows as read_rows
    from .results import write_rows as write_rows
    from .study import Study as Study
    from .study import drive_channel as drive_channel

_SOURCE_MODULES = {
    "inspect": "quality",
    "require_sound": "quality",
    "ResultRow": "results",
    "read_rows": "results",
    "write_rows": "results",
    "Study": "study",
    "drive_channel": "study",
}


def __getattr__(name: str):
    if name not in _SOURCE_MODULES:
        there = ", ".join(sorted(_SOURCE_MODULES))
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {there}")
    from importlib import import_module

    return getattr(import_module(f".{_SOURCE_MODULES[name]}", __name__), name)
