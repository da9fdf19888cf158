"""A virtual elbow exoskeleton with a slider, its instruments and its protocols."""
