"""Muscles, their geometry, and cards of what was calibrated."""
