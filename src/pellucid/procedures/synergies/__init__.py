"""Muscle synergies."""

from ..command import Command

PROCEDURE_ORDER = 130
PROCEDURE_COMMAND = Command("synergies", "Groups of muscles that move together.")
