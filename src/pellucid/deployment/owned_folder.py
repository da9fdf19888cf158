"""A folder that an export writes to says what it holds, so that no other export replaces it by mistake."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from .._atomic import write_text_atomically
from .._errors import PellucidError
from .._given import read_given, require_folder, visible_text

OWNER_FILE = "pellucid.json"
"""File of an exported folder that says what Pellucid wrote there."""

MAX_OWNER_BYTES = 100_000
"""Largest size of an owner file that is read: it holds a few names."""


def require_own_folder(folder: Path, owner: Mapping[str, str], names: Iterable[str], *, overwrite: bool) -> None:
    """Raise a PellucidError if `folder` holds something else than the `owner` that is to be written.

    `names` are the files and folders that will be written in it; `overwrite` lets all of them be replaced.
    """
    require_folder(folder, "a folder to write to")
    if overwrite:
        return
    found = _owner_of(folder)
    if found is None:
        there = sorted(name for name in {*names, OWNER_FILE} if (folder / name).exists())
        if there:
            raise PellucidError(
                f"{folder}: found {', '.join(there[:5])}, without a word of Pellucid's that they are its own; expected "
                f"none of these. {_WAY_OUT}"
            )
        return
    if found != dict(owner):
        raise PellucidError(f"{folder}: found {_told(found)}, expected {_told(owner)} or nothing. {_WAY_OUT}")


def mark_own_folder(folder: Path, owner: Mapping[str, str]) -> Path:
    """Write into `folder` whose it is."""
    return write_text_atomically(folder / OWNER_FILE, json.dumps(dict(owner), indent=1, ensure_ascii=False) + "\n")


_WAY_OUT = "Name another folder with --out, or let it be replaced: --overwrite (overwrite=True)"


def _owner_of(folder: Path) -> dict[str, str] | None:
    """Return what a folder says that it holds; None if it says nothing that can be understood."""
    try:
        found = json.loads(read_given(folder / OWNER_FILE, MAX_OWNER_BYTES).decode("utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    whole = isinstance(found, dict) and all(isinstance(x, str) for x in found.values())
    return found if whole else None


def _told(owner: Mapping[str, str]) -> str:
    """Say an owner in words."""
    return visible_text(", ".join(f"{key} {value}" for key, value in owner.items() if value) or "nothing")[:300]
