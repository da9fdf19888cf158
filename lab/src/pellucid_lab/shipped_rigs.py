"""Files of the rigs that come with a package: this one, and others that bring rigs by entry points."""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from types import ModuleType

from pellucid._errors import StudyError
from pellucid._given import read_given
from pellucid._plugins import load_plugins, require_attributes

MAX_RIG_FILE_BYTES = 3_000_000
"""Largest size of a rig's file [B]."""


def rig_packages() -> tuple[ModuleType, ...]:
    """Return the packages with rigs, entry points of ``pellucid.rigs``: a folder with rig.py for each kind."""
    plugins = load_plugins("pellucid.rigs")
    for plugin in plugins:
        require_attributes(plugin, "pellucid.rigs", "__path__")
    return tuple(plugin.value for plugin in plugins)


def shipped_rig_names() -> tuple[str, ...]:
    """Return the names of the rigs whose files come with a package."""
    return tuple(sorted(_shipped_files()))


def shipped_rig(name: str) -> str:
    """Return the text of the file ``rigs/<name>.toml`` of a package with rigs."""
    return _shipped_files()[name].read_text(encoding="utf-8")


def text_of_rig(path: Path) -> str:
    """Return the text of a rig's file."""
    try:
        return read_given(path, MAX_RIG_FILE_BYTES).decode("utf-8")
    except UnicodeDecodeError as error:
        raise StudyError(f"{path}: not readable: {error}") from None


def _shipped_files() -> dict[str, Traversable]:
    """Return the file of each rig that comes with a package, by the rig's name."""
    found: dict[str, Traversable] = {}
    for package in rig_packages():
        folder = files(package) / "rigs"
        for file in folder.iterdir() if folder.is_dir() else ():
            if file.name.endswith(".toml"):
                found.setdefault(file.name.removesuffix(".toml"), file)
    return found
