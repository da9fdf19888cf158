"""An exoskeleton's swings, empty and with legs in it."""
