"""Export identified controllers as source code for microcontrollers, with tests that they compute the same there."""
