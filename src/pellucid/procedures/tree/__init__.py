"""A robot of several joints, identified at once."""

ORDER = 30
