"""Posteriors for few data: what is known of a parameter, drawn, beside the intervals of least squares."""
