"""Posteriors for few data: samples of the parameters, in addition to the intervals of least squares."""
