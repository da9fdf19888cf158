"""What EMG tells of a force in contractions against a load cell."""

from ..command import Command

PROCEDURE_ORDER = 125
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("emg-force", "What EMG tells of force in contractions against a load cell, over people.")
"""Command that runs this procedure alone."""
