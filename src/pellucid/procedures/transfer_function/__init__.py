"""A linear model from one channel to another."""

ORDER = 40
