"""Single faults on virtual robots that somebody wears, and what comes of them."""
