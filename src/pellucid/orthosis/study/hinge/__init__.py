"""The angle of a joint from the two inertial sensors beside it."""

PROCEDURE_ORDER = 50
"""Position of this procedure among all procedures; the smallest comes first."""
