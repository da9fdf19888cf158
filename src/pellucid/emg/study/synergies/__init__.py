"""Muscle synergies."""

from ....study.procedures.command import PEOPLE_GROUP, Command

PROCEDURE_ORDER = 130
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("synergies", "Find groups of muscles that are active together.", PEOPLE_GROUP)
"""Command that runs this procedure alone."""
