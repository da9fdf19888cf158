"""The subject of a command: the folder of a study as a path, an open study, or arrays."""

from __future__ import annotations

import os

from ..._errors import PellucidError
from ..study import Study
from .registry import open_study


def is_study(subject: object) -> bool:
    """Return whether a subject is a study: an open one, or a path to its folder."""
    return isinstance(subject, (Study, str, os.PathLike))


def as_study(subject: object, caller: str) -> Study:
    """Return the study that a subject names; PellucidError of the function `caller` where it is no study."""
    if isinstance(subject, Study):
        return subject
    if isinstance(subject, (str, os.PathLike)):
        return open_study(subject)
    raise PellucidError(
        f"{caller}: found {type(subject).__name__}, expected a study: the path of its folder, or what pellucid.open "
        "returns"
    )
