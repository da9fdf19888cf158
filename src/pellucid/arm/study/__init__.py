"""A robot of several joints, identified together."""
