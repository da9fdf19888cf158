"""What drives add as they go round."""

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..tree_result import TreeResult


def find(case: TreeResult) -> Iterator[Verdict]:
    """Where a ripple was found."""
    for ripple in case.best.ripples:
        joint, unit = case.names[ripple.motor], case.effort_units[ripple.motor]
        yield Verdict(
            "note",
            f"The drive of {joint} adds a ripple of {ripple.amplitude:.3g} {unit}, {ripple.order:.4g} times in a turn, "
            "gears taken out; it is in the model.",
        )
