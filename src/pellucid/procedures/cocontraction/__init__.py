"""Co-contraction of antagonists."""
