"""How much antagonists work against each other."""
