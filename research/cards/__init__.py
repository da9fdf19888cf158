"""The cards of identified machines, made from public recordings: ``python -m research.cards [NAME ...]``."""
