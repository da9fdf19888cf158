"""What there may be to say of an identified robot: a file for each finding, with a function ``find(case)``."""
