"""A wearer strapped to an orthosis: recordings to both bodies and what couples them."""

PROCEDURE_ORDER = 60
"""Position of this procedure among all procedures; the smallest comes first."""
