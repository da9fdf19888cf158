"""Onsets of muscle activity."""

from ..command import Command

ORDER = 110
COMMAND = Command("onset", "When muscles become active, from raw EMG, with intervals.")
