"""What a study can be asked: one folder for each, in which what it needs, finds and shows stands together."""
