"""The angle of a joint from the two inertial sensors beside it."""
