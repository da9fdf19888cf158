"""Onsets of muscle activity."""

from ....study.procedures.command import PEOPLE_GROUP, Command

PROCEDURE_ORDER = 110
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("onset", "Find when muscles become active, from raw EMG.", PEOPLE_GROUP)
"""Command that runs this procedure alone."""
