"""A robot of several joints, identified at once."""
