"""A leg that swings a known load: its mass, its damping and the torque of its muscles."""
