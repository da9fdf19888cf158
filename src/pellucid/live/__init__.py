"""A live session's engine: a process with law, supervisor and deadline, its shared memory, recorder and streams."""
