"""Searches over many parameters that know nothing of what they search for."""
