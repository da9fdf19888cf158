"""Rank controllers on one page: all reviewed strategies at elbow, knee and arm over simulated people and robots."""
