"""Mark the folder of an export with its contents, so that no other export replaces it by mistake."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from ..._given import read_given, require_folder, visible_text

OWNER_FILE = "pellucid.json"
"""File of an exported folder that states what Pellucid wrote there."""

MAX_OWNER_BYTES = 100_000
"""An owner file has at most this size, since it holds only a few names."""


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
        raise PellucidError(
            f"{folder}: found {_describe_owner(found)}, expected {_describe_owner(owner)} or nothing. {_WAY_OUT}"
        )


def mark_own_folder(folder: Path, owner: Mapping[str, str]) -> Path:
    """Write the `owner` into its file in `folder`."""
    return write_text_atomically(folder / OWNER_FILE, json.dumps(dict(owner), indent=1, ensure_ascii=False) + "\n")


_WAY_OUT = "Name another folder with --out, or let it be replaced: --overwrite (overwrite=True)"
"""End of a refusal to write into a folder: what the caller can do."""


def _owner_of(folder: Path) -> dict[str, str] | None:
    """Return the owner that a folder states; None if it has no readable owner file."""
    try:
        found = json.loads(read_given(folder / OWNER_FILE, MAX_OWNER_BYTES).decode("utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    whole = isinstance(found, dict) and all(isinstance(x, str) for x in found.values())
    return found if whole else None


def _describe_owner(owner: Mapping[str, str]) -> str:
    """Return a description of an owner."""
    return visible_text(", ".join(f"{key} {value}" for key, value in owner.items() if value) or "nothing")[:300]
