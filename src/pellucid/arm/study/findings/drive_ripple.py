"""Finding: ripple of the drives."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..tree_result import TreeResult


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report each drive with a ripple."""
    ripple_texts = [
        f"{case.names[r.motor]} {r.amplitude:.2g} {case.effort_units[r.motor]}, {r.order:.4g} times in a turn"
        for r in case.best.ripples
    ]
    if ripple_texts:
        text = (
            f"Drives add a ripple as they go round, which is in the model (gears taken out): {'; '.join(ripple_texts)}."
        )
        yield Verdict("note", text)
