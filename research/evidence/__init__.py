"""What Pellucid claims besides speed, measured: ``python -m research.evidence [NAME ...] [--out FILE]``."""
