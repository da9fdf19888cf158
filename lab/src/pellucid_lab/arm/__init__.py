"""A virtual arm exoskeleton of four joints and a slider, and its wearers."""
