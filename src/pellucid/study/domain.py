"""Studies: what this room offers to those below it, as `_domains.py` describes."""

PARAMETER_DRAWINGS = ("pages.forest:parameters",)
