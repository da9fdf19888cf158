"""Studies: what study.toml says of recordings, how sound they are, and the results that are kept of them."""
