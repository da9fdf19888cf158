"""A joint with a carriage: recordings to three-step and coherent models."""

PROCEDURE_ORDER = 20
"""Position of this procedure among all procedures; the smallest comes first."""
