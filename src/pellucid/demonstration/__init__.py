"""The whole flow in a minute, and the proof that the intervals it prints are honest."""
