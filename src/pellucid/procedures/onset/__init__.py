"""When muscles become active."""
