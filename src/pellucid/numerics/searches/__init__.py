"""General-purpose optimisers: Adam, bounded least squares, particle swarm and conjugate gradients."""
