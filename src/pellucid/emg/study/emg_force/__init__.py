"""Correlation of EMG with force in contractions against a load cell."""
