"""What EMG tells of a force in contractions against a load cell."""

from ....study.procedures.command import PEOPLE_GROUP, Command

PROCEDURE_ORDER = 125
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("emg-force", "Compare EMG with force in contractions that do not move.", PEOPLE_GROUP)
"""Command that runs this procedure alone."""
