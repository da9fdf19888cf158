"""Co-contraction of antagonists."""

from ..command import Command

ORDER = 120
COMMAND = Command("cocontraction", "How much antagonists work against each other.")
