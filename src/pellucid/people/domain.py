"""Movements of people: what it offers to the rest of Pellucid, as `_domains.py` describes."""

PROCEDURE_FOLDERS = (
    "study",
)
ARRAY_FUNCTIONS = {
    "assess": "assess_table:assess_table",
}
