"""A linear model from one channel to another."""

PROCEDURE_ORDER = 40
"""Position of this procedure among all procedures; the smallest comes first."""
