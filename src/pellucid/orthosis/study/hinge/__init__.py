"""The angle of a joint from the inertial sensors on its two segments."""
