"""What Pellucid takes beside what a user would otherwise use, in one run: ``python -m research.benchmarks``."""
