"""What there may be to say of an identified joint: a file for each finding, with a function ``find(case)``."""
