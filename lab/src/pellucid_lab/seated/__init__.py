"""A virtual knee robot on a seated person whose muscles have a truth."""
