"""Findings on an identified robot: one file for each, with a function ``find(case)``."""
