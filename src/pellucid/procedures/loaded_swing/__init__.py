"""An exoskeleton's swings, empty and with legs in it."""

PROCEDURE_ORDER = 70
