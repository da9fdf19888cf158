"""A virtual joint on a bench."""
