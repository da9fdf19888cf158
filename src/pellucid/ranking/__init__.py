"""Rank controllers on one page: all reviewed strategies, at elbow and knee, over drawn people and robots."""
