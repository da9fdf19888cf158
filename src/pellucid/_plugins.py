"""Find what other installed packages add to Pellucid: entry points, loaded when they are first needed.

A package names its additions in its own pyproject.toml, and nothing in Pellucid changes::

    [project.entry-points."pellucid.readers"]
    acme = "acme_pellucid.acme_log"

`PLUGIN_GROUPS` says what an entry of each group must be. The distribution `pellucid-lab` brings its rigs, papers and
commands in this way.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from ._errors import PluginError

PLUGIN_GROUPS = {
    "pellucid.readers": "a module with ENDINGS and read(path), as those in pellucid/files/readers",
    "pellucid.estimators": "a module with FAMILIES, as those in pellucid/emg/estimators/families",
    "pellucid.procedures": "a ProcedureEntry as in domain.py, or a package with PROCEDURE_ORDER and procedure.py",
    "pellucid.rigs": "a package whose folders have a rig.py each, with the rigs' files in its folder rigs",
    "pellucid.papers": "a package whose folders have printed.toml and paper.py each",
    "pellucid.study_sources": "a function (folder, name) that starts a study; its entry's name is its option of init",
    "pellucid.devices": "a function (conditions, place, seed) that returns the setup of a live session's engine",
    "pellucid.robots": "a function (folder) that returns a function (worn, period) for its virtual robot, or None",
    "pellucid.commands": "a function that adds its commands to the Typer application it is given",
}
"""What an entry point of each group must load."""


@dataclass(frozen=True)
class Plugin:
    """One entry point of an installed package, with the object that it names."""

    name: str  # name of the entry point
    distribution: str  # name of the distribution that brings it
    value: Any  # module, package or function, as `PLUGIN_GROUPS` says


@cache
def load_plugins(group: str) -> tuple[Plugin, ...]:
    """Return what installed packages add to a group, sorted by distribution and name.

    Raises
    ------
    PluginError
        If an entry point cannot be loaded. The message names its distribution.
    """
    expected = PLUGIN_GROUPS[group]
    found: dict[tuple[str, str], Plugin] = {}
    for entry in _entries(tuple(sys.path)):
        if entry.group != group:
            continue
        try:
            value = entry.load()
        except Exception as error:  # a stranger's module may raise anything when it is imported
            raise PluginError(
                f"plug-in {entry.name} of {entry.distribution} ({group}): found {error!r} on loading "
                f"{entry.reference}, expected {expected}; to go on without it: pip uninstall {entry.distribution}"
            ) from error
        # An editable installation beside an installed one shows the same entry twice.
        found[entry.distribution, entry.name] = Plugin(entry.name, entry.distribution, value)
    return tuple(found[key] for key in sorted(found))


@dataclass(frozen=True)
class _Entry:
    """One line of an installed distribution's entry_points.txt."""

    distribution: str
    group: str
    name: str
    reference: str  # package.module, or package.module:attribute

    def load(self) -> Any:
        """Import what it refers to."""
        module, _, attribute = self.reference.partition(":")
        found = import_module(module.strip())
        for part in filter(None, attribute.strip().split(".")):
            found = getattr(found, part)
        return found


@cache
def _entries(folders: tuple[str, ...]) -> tuple[_Entry, ...]:
    """Return the entries of all groups of Pellucid, from the distributions in the folders of a path.

    The files are read here rather than by `importlib.metadata`, whose import alone takes longer than the help.
    """
    from configparser import ConfigParser

    found = []
    for folder in dict.fromkeys(folders):
        for file in sorted(Path(folder or ".").glob("*.*-info/entry_points.txt")):
            text = file.read_text(encoding="utf-8", errors="replace")
            if "[pellucid." not in text:
                continue
            lines = ConfigParser(delimiters=("=",), interpolation=None)
            lines.optionxform = str  # type: ignore[assignment, method-assign]
            lines.read_string(text)
            distribution = file.parent.name.split("-")[0].replace("_", "-")
            for group in lines.sections():
                found += [_Entry(distribution, group, name, reference) for name, reference in lines[group].items()]
    return tuple(found)


def require_attributes(plugin: Plugin, group: str, *names: str) -> None:
    """PluginError if what a plug-in loads lacks one of the attributes that its group asks for."""
    missing = [name for name in names if not hasattr(plugin.value, name)]
    if missing:
        raise PluginError(
            f"plug-in {plugin.name} of {plugin.distribution} ({group}): found no {', '.join(missing)}, expected "
            f"{PLUGIN_GROUPS[group]}"
        )
