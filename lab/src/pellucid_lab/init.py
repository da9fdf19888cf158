"""A new study of a virtual rig. `pellucid.init` finds this module as an entry point of ``pellucid.study_sources``."""

from __future__ import annotations

import os
from pathlib import Path

from pellucid._atomic import write_text_atomically
from pellucid._given import require_empty_folder
from pellucid.study.study_place import RIG_FILE

from .known_rigs import rig_names, rig_text


def start_study(folder: str | os.PathLike, rig: str) -> Path:
    """Make a folder with a copy of a virtual rig's file, ``lab/rig.toml``, that may be edited."""
    folder, text = Path(folder), rig_text(rig)
    require_empty_folder(folder)
    return write_text_atomically(folder / RIG_FILE, text)


def study_names() -> tuple[str, ...]:
    """Return the names of the virtual rigs that come with the package."""
    return rig_names()
