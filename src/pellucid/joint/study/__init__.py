"""A joint with friction: recordings to families, verdicts and a report."""

PROCEDURE_ORDER = 10
"""Position of this procedure among all procedures; the smallest comes first."""
