"""Muscle synergies."""

from ..command import Command

ORDER = 130
COMMAND = Command("synergies", "Groups of muscles that move together.")
