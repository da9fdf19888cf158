"""Verdict on each estimated parameter of a robot, in a word."""

from __future__ import annotations

from ...models.parameter import Parameter
from .friction_terms import STRIBECK_VELOCITY_NAME
from .tree_estimate import TreeEstimate

IDENTIFIED_VERDICT = "identified"
"""Verdict on a parameter whose 95 % interval excludes 0."""

WEAK_VERDICT = "weak"
"""Verdict on a parameter whose 95 % interval contains 0."""

ON_BOUND_VERDICT = "on a bound"
"""Verdict on a parameter that a physical bound holds."""

NOT_IDENTIFIABLE_VERDICT = "not identifiable"
"""Verdict on a parameter that the recordings do not determine."""


def parameter_verdict(parameter: Parameter) -> str:
    """Return the verdict on a parameter: identified, weak, on a bound, or not identifiable."""
    if parameter.at_bound:
        return ON_BOUND_VERDICT
    if parameter.refused and not parameter.standard_error:
        return NOT_IDENTIFIABLE_VERDICT
    return IDENTIFIED_VERDICT if parameter.identifiable else WEAK_VERDICT


def parameter_verdicts(estimate: TreeEstimate) -> dict[str, str]:
    """Return the verdict on every fitted parameter by name."""
    return {
        name: parameter_verdict(p)
        for name, p in estimate.parameters.items()
        if not name.endswith(STRIBECK_VELOCITY_NAME)
    }
