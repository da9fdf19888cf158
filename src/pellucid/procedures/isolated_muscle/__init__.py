"""One muscle, fully active, whose free end is moved."""

PROCEDURE_ORDER = 100
