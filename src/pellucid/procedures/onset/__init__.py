"""Onsets of muscle activity."""

from ..command import Command

PROCEDURE_ORDER = 110
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("onset", "When muscles become active, from raw EMG, with intervals.")
"""Command that runs this procedure alone."""
