"""The angle of a joint from the two inertial sensors beside it."""

PROCEDURE_ORDER = 50
