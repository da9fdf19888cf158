"""Do conditions change how people move: from recordings to tests, tables and sentences."""

PROCEDURE_ORDER = 140
"""Position of this procedure among all procedures; the smallest comes first."""
