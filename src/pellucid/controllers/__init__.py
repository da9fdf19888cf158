"""Controllers built from identified parameters: they know physics and no data."""
