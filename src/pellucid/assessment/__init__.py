"""Judging: whether conditions differ, and by how much, from what participants did under each."""
