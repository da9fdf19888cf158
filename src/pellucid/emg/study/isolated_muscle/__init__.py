"""One muscle, fully active, whose free end is moved."""
