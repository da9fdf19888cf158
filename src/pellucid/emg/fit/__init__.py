"""Parameters of Hill muscles: what is free, the search, and what the data can tell of each."""
