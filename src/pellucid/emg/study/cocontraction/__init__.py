"""Co-contraction of antagonists."""

from ....study.procedures.command import PEOPLE_GROUP, Command

PROCEDURE_ORDER = 120
PROCEDURE_COMMAND = Command("cocontraction", "Measure how much antagonists work against each other.", PEOPLE_GROUP)
