"""What EMG tells of a force in contractions against a load cell."""
