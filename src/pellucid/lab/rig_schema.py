"""What a rig's file may say: the types of the rig of its kind that comes with the package, and numbers like its."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

from .._errors import StudyError
from .._given import visible_text

LIKE = 1000.0
"""How many times a number may be that of the package's own rig."""

LONGER = 10.0
"""How many times a rate, a duration or a count may be that, since the work grows with it."""

WORK = ("rate", "duration", "substeps", "repetitions", "realisations", "periods", "resolution")
"""Keys of numbers that the work grows with."""

POSITIVE = re.compile(
    "frequency|rate$|duration|mass|inertia|velocity$|acceleration$|speed|length|(?<!relaxing_)stiffness$|period|counts|ratio|constant|"
    "limit|longest|span$|substeps"
)
"""Keys of numbers that are never 0."""

ANY = 1e6
"""Largest number where the package's own rig has none, or 0."""

MOST = 1000
"""Characters of a text, entries of a list."""


def require_like(found: Any, reference: Any, where: str, free: Collection[str] = ()) -> None:
    """StudyError if something in a rig's file is not of the type, the sign or the magnitude of `reference`; tables that
    are `free` may have keys that it lacks."""
    if isinstance(reference, Mapping):
        if not isinstance(found, Mapping):
            raise StudyError(f"{where}: found {_short(found)}, expected a table")
        # Tables that people name, as subjects are, are all like the first.
        named = list(reference.values()) if all(isinstance(x, Mapping) for x in reference.values()) else []
        for key, value in found.items():
            own = reference.get(key, named[0] if named else None)
            if own is None and where.rpartition(" ")[2] not in free:
                raise StudyError(f"{where}: found {visible_text(key)[:50]}, expected some of {', '.join(reference)}")
            require_like(value, own, f"{where} {visible_text(key)[:50]}", free)
    elif reference is None:
        _require_anything(found, where)
    elif isinstance(reference, list):
        if not isinstance(found, list) or len(found) > MOST or not found:
            raise StudyError(f"{where}: found {_short(found)}, expected a list")
        for i, value in enumerate(found):
            require_like(value, reference[min(i, len(reference) - 1)], f"{where}[{i}]", free)
    elif isinstance(reference, str):
        if not isinstance(found, str) or len(found) > MOST or visible_text(found) != found:
            raise StudyError(f"{where}: found {_short(found)}, expected a text")
    elif type(found) is bool or type(reference) is bool:
        if type(found) is not type(reference):
            raise StudyError(f"{where}: found {_short(found)}, expected {reference!r} or so")
    else:
        _require_number(found, reference, where)


def _require_number(found: Any, reference: float, where: str) -> None:
    if not isinstance(found, (int, float)) or (isinstance(reference, int) and not isinstance(found, int)):
        kind = "a whole number" if isinstance(reference, int) else "a number"
        raise StudyError(f"{where}: found {_short(found)}, expected {kind} such as {reference}")
    key = where.rpartition(" ")[2].partition("[")[0]
    work = key in WORK
    high = (LONGER if work else LIKE) * abs(reference) if reference else ANY
    low = -high if reference <= 0 else reference / (LONGER if work else LIKE)
    if not low <= found <= high and (found != 0 or work or POSITIVE.search(key)):
        raise StudyError(f"{where}: found {_short(found)}, expected {low:g} to {high:g}")


def _require_anything(found: Any, where: str) -> None:
    """A number, a text or a list of them that the package's own rig does not have."""
    for x in found if isinstance(found, list) and len(found) <= MOST else (found,):
        number = isinstance(x, (int, float)) and abs(x) <= ANY
        if not number and not (isinstance(x, str) and len(x) <= MOST and visible_text(x) == x):
            raise StudyError(f"{where}: found {_short(found)}, expected a number up to {ANY:g} or a short text")


def _short(x: Any) -> str:
    try:
        return visible_text(repr(x))[:100]
    except ValueError:  # an integer too long to be written
        return "a number of too many digits"
