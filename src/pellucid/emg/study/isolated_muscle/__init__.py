"""One muscle, fully active, whose free end is moved."""

PROCEDURE_ORDER = 100
"""Position of this procedure among all procedures; the smallest comes first."""
