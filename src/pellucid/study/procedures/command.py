"""Folders of procedures, and the commands that they bring to the command line.

Nothing heavy is imported here: ``pellucid --help`` names every command.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

from ..._domains import offered
from ..._plugins import load_plugins, require_attributes

DESCRIBE_GROUP = "Describe recordings"
IDENTIFY_GROUP = "Identify robot, limb and muscles"
PEOPLE_GROUP = "Work with people"
DEPLOY_GROUP = "Deploy a controller"
LEARN_GROUP = "Learn without hardware"
HELP_GROUPS = (DESCRIBE_GROUP, IDENTIFY_GROUP, PEOPLE_GROUP, DEPLOY_GROUP, LEARN_GROUP)
"""Headings of ``pellucid --help``, in their order; a command without one stands under the last of them."""


@dataclass(frozen=True)
class Command:
    """A command of ``pellucid`` that runs procedures on one study.

    A folder brings it as ``PROCEDURE_COMMAND`` in its ``__init__.py``. `identify` and `assess`, which have options of
    their own, are written in `cli.py`.
    """

    name: str
    help: str  # One line, at most 58 characters: what ``pellucid --help`` prints
    group: str = IDENTIFY_GROUP  # One of `HELP_GROUPS`, under which it is listed
    reads_cards: bool = False  # Whether it offers ``--accept-stale``, because procedures read cards of other commands


def procedure_folders() -> tuple[ModuleType, ...]:
    """Return the package of every procedure's folder, in the order of their ``PROCEDURE_ORDER``.

    A study is checked, and its report drawn, in this order. Domains name their folders in ``domain.py``; another
    package brings such a folder as an entry point of ``pellucid.procedures``.
    """
    folders = list(offered("PROCEDURE_FOLDERS"))
    for plugin in load_plugins("pellucid.procedures"):
        require_attributes(plugin, "pellucid.procedures", "PROCEDURE_ORDER", "__path__")
        folders.append(plugin.value)
    return tuple(sorted(folders, key=lambda folder: folder.PROCEDURE_ORDER))


def procedure_commands() -> tuple[Command, ...]:
    """Return the commands that folders bring, in the order of the folders."""
    return tuple(folder.PROCEDURE_COMMAND for folder in procedure_folders() if hasattr(folder, "PROCEDURE_COMMAND"))
