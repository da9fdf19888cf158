"""Where estimators disagree with least squares by more than both intervals allow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....fit.parameter import Verdict
from ..joint_case import JointCase

METHODS = {
    "wls": "Weighted least squares",
    "irls": "Robust least squares",
    "iv": "The instrumental-variable estimate",
    "didim": "DIDIM",
    "output_error": "The output-error fit",
}


def find(case: JointCase) -> Iterator[Verdict]:
    """Each estimator that disagrees, and on what."""
    for name, other in case.fit.others.items():
        apart = [
            q.name.replace("_", " ")
            for q in other.parameters
            for p in (case.fit.estimate[q.name],)
            if abs(p.value - q.value) > 3.0 * np.hypot(p.standard_error, q.standard_error) and not q.at_bound
        ]
        if apart:
            yield Verdict(
                "note",
                f"{METHODS.get(name, name)} disagrees with ordinary least squares on {', '.join(apart)} by more than "
                "three standard errors: the friction model is not the whole truth, and each method weighs the misfit "
                "differently.",
            )
