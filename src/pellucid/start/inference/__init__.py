"""What columns of numbers are, by evidence: arrays and names in, findings with their reasons out. It reads no file."""
