"""Single faults on virtual robots that somebody wears: whether and when the supervisor finds them."""
