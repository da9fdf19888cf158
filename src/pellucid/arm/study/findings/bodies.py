"""Finding: the increase of the error by physically consistent links."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..tree_result import ROW_KIND_DESCRIPTIONS, TreeResult

MAX_NEGLIGIBLE_LOSS = 0.1
"""Largest increase of the mean error that is negligible, in percentage points."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the increase of the error, and models that failed."""
    for model, why in case.failures.items():
        yield Verdict("warning", f"No {model} model: {why}.", "Check masses, signs and gears.")
    best, bodies = case.errors_of("best", case.judged), case.errors_of("consistent", case.judged)
    if best is None or bodies is None:
        return
    loss = bodies.mean - best.mean
    notes_text = "; ".join(case.models["consistent"].notes)
    text = f"Bodies that can exist change the mean error on {ROW_KIND_DESCRIPTIONS[case.judged]} by {loss:+.2g} points"
    text += f" ({notes_text})." if notes_text else "."
    if loss <= MAX_NEGLIGIBLE_LOSS:
        yield Verdict("good", text)
    else:
        yield Verdict(
            "warning", text, "Check masses, signs and gears: efforts ask for bodies that cannot be.", weight=loss
        )
