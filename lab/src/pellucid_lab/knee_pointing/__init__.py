"""People who point with the shank, free and in the virtual knee orthosis."""
