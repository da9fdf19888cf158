"""A robot of several joints, identified together."""

PROCEDURE_ORDER = 30
"""Position of this procedure among all procedures; the smallest comes first."""
