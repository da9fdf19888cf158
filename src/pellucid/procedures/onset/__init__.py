"""Onsets of muscle activity."""
