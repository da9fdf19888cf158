"""A linear model from one channel to another."""

PROCEDURE_ORDER = 40
