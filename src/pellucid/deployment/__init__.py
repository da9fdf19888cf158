"""Off the PC: identified controllers as source that a microcontroller runs, with what proves that it runs the same."""
