"""Indices of movements, and statistics of conditions: arrays in, tests, effect sizes and intervals out."""
