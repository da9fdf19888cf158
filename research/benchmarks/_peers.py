"""Other people's libraries that benchmarks compare with, where they are installed."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from types import ModuleType


@cache
def peer(benchmark: str, library: str) -> ModuleType | None:
    """Return a library, or None where it is not installed; say so once for each benchmark."""
    try:
        return import_module(library)
    except ImportError:
        print(f"{benchmark}: not compared with {library}, which is not installed", flush=True)
        return None
