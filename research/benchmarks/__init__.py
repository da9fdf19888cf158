"""Time that Pellucid takes, and time of the usual alternatives, in one run: ``python -m research.benchmarks``."""
