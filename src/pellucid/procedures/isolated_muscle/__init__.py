"""One muscle, fully active, whose free end is moved."""

ORDER = 100
