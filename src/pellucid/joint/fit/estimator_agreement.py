"""Estimators of one friction family that disagree with least squares."""

from __future__ import annotations

import numpy as np

from ...models.estimates import Parameter
from ...numerics.distributions import normal_quantile
from .friction_family import FamilyFit
from .joint_estimate import JointEstimate

MIN_DISAGREEMENT_EFFORT_SHARE = 0.02
"""A difference between two values is reported only if it changes the effort by more than this share (RMS)."""

DISAGREEMENT_DOUBT = "estimators disagree"
"""Note on a parameter whose interval excludes the estimate of another estimator."""


def differing_estimates(fit: FamilyFit, level: float) -> tuple[dict[str, JointEstimate], dict[str, list[str]]]:
    """Return a family's estimates by method, and the methods that disagree with least squares by parameter."""
    estimates = {fit.estimate.method: fit.estimate, **{n: e for n, e in fit.others.items() if e.converged}}
    apart = {p.name: _disagreeing_methods(p, estimates, level) for p in fit.estimate.parameters}
    return estimates, {name: methods for name, methods in apart.items() if methods}


def names_outside(fit: FamilyFit, level: float) -> list[str]:
    """Return the parameters whose interval in the headline excludes an estimate that disagrees."""
    estimates, apart = differing_estimates(fit, level)
    head, outside = fit.headline.estimate, []
    for name, methods in apart.items():
        low, high = head[name].interval(level)
        if any(not low <= estimates[method][name].value <= high for method in ("ls", *methods)):
            outside.append(name)
    return outside


def _disagreeing_methods(parameter: Parameter, estimates: dict[str, JointEstimate], level: float) -> list[str]:
    """Return the methods whose interval of a parameter does not overlap that of least squares.

    The level holds for all comparisons together.
    """
    if parameter.at_bound:
        return []
    count = max(1, sum(len(e.parameters) for m, e in estimates.items() if m != "ls"))
    times = normal_quantile(1.0 - 0.5 * (1.0 - level) / count)
    found = []
    for method, estimate in estimates.items():
        other = estimate.get(parameter.name)
        if method == "ls" or other is None or other.at_bound:
            continue
        difference = abs(other.value - parameter.value)
        sure = difference > times * np.hypot(other.standard_error, parameter.standard_error)
        if sure and difference * parameter.influence > MIN_DISAGREEMENT_EFFORT_SHARE:
            found.append(method)
    return found
