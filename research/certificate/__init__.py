"""A challenge of the certificate: studies with known truth, from a generator that knows nothing of the analysis."""
