"""A joint with friction: recordings to families, verdicts and a report."""
