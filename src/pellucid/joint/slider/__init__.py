"""Identify a joint with a movable carriage: by the published three steps, and as one physically consistent body."""
