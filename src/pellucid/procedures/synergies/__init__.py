"""Muscle synergies."""

from ..command import Command

PROCEDURE_ORDER = 130
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("synergies", "Groups of muscles that move together.")
"""Command that runs this procedure alone."""
