"""A joint that carries a movable mass: the published three steps, and one body in their place."""
