"""One joint: what it offers to the rest of Pellucid, as `_domains.py` describes."""

PROCEDURE_FOLDERS = (
    "study",
    "slider.study",
)
