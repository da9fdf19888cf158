"""Control laws of a robot that is worn or held, built from what was identified; `controller` makes one by its name."""
