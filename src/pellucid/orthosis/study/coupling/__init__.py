"""A wearer strapped to an orthosis: recordings to both bodies and what couples them."""
