"""Commands that procedures bring to the command line, and the groups in which its help lists them."""

from __future__ import annotations

from dataclasses import dataclass

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

    A procedure brings it. `identify` and `assess`, which have options of their own, are written in `cli.py`.
    """

    name: str
    help: str  # One line, at most 58 characters: what ``pellucid --help`` prints
    group: str = IDENTIFY_GROUP  # One of `HELP_GROUPS`, under which it is listed
    reads_cards: bool = False  # Whether it offers ``--accept-stale``, because procedures read cards of other commands
    typed: str = ""  # What is typed for it after ``pellucid``: "emg force"; empty for its name

    @property
    def words(self) -> list[str]:
        """What is typed for it after ``pellucid``, word by word."""
        return (self.typed or self.name).split()
