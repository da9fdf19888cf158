"""What Pellucid claims besides speed, measured: ``python -m evidence [NAME ...] [--out FILE]``."""
