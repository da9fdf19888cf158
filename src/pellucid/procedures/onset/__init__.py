"""Onsets of muscle activity."""

from ..command import Command

PROCEDURE_ORDER = 110
PROCEDURE_COMMAND = Command("onset", "When muscles become active, from raw EMG, with intervals.")
