"""A linear model from one channel to another."""
