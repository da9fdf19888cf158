"""The ABLE elbow exoskeleton: direction-dependent identification, and how transparent its laws are."""
