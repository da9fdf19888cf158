"""Co-contraction of antagonists."""

from ..command import Command

PROCEDURE_ORDER = 120
PROCEDURE_COMMAND = Command("cocontraction", "How much antagonists work against each other.")
