"""What columns of numbers are, by evidence: arrays and names in, findings and reasons out. It reads no recording."""
