"""Physics, which knows no data: Python faces of the core's models, and the model cards that carry identified ones."""
