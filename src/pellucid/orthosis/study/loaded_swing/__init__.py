"""An exoskeleton's swings, empty and with legs in it."""

PROCEDURE_ORDER = 70
"""Position of this procedure among all procedures; the smallest comes first."""
