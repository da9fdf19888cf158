"""Estimation of Hill muscle parameters: free parameters, optimization, and their identifiability."""
