"""One joint: identification, the joint with a carriage, study."""
