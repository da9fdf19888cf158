"""Findings on an identified joint: one file for each, with a function ``find(case)``."""
