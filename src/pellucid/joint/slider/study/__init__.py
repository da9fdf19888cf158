"""A joint with a carriage: recordings to three-step and coherent models."""
