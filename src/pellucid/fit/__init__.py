"""From recordings to parameters: regression, physical consistency, closed-loop methods, uncertainty, verdicts."""
