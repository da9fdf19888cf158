"""Excitations: the motions a joint is asked to make so that its parameters show."""
