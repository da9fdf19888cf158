"""Muscle synergies."""
