"""What the recordings show of each number, in a word."""

from __future__ import annotations

from ..parameter import Parameter
from .tree_estimate import TreeEstimate

IDENTIFIED, WEAK, ON_A_BOUND, NOT_IDENTIFIABLE = "identified", "weak", "on a bound", "not identifiable"


def state_of(parameter: Parameter) -> str:
    """Of an estimated number: identified where its 95 % interval leaves out 0; else weak, on a bound, or not
    identifiable."""
    if parameter.at_bound:
        return ON_A_BOUND
    if parameter.refused and not parameter.standard_error:
        return NOT_IDENTIFIABLE
    return IDENTIFIED if parameter.identifiable else WEAK


def states(estimate: TreeEstimate) -> dict[str, str]:
    """Of every number that was fitted."""
    return {name: state_of(p) for name, p in estimate.parameters.items() if not name.endswith("stribeck_velocity")}
