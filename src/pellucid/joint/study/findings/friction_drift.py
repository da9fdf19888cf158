"""Finding: friction changes within a recording, as that of a gear that warms up does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ....models.fields import largest_friction, model_fields
from ....models.friction_terms import TERMS
from ....models.parameter import Verdict
from ....study.pages.quantities import number, unit_text
from ...fit.friction_drift import find_friction_drift
from ..joint_case import JointCase

MIN_LEVEL_SHARE = 0.25
"""A drift is told if it is at least this share of the friction at the recording's median speed."""

MIN_Z_VALUE = 4.0
"""A drift is told if it is at least this many standard errors."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the fitted recording in which friction drifts most, and how many others there are."""
    found = []
    values = dict(zip(case.fit.model.names, case.fit.estimate.array, strict=True))
    for each in case.fit.predictions:
        if each.split != "fitted" or len(each.time) < 2:
            continue
        drift = find_friction_drift(each.time, each.velocity, each.residual)
        usual = _friction_at(values, float(np.median(np.abs(each.velocity))))
        if drift is not None and abs(drift.z_value) > MIN_Z_VALUE and abs(drift.change) > MIN_LEVEL_SHARE * usual > 0.0:
            found.append((abs(drift.change) / usual, each, drift))
    if not found:
        return
    share, worst, drift = max(found, key=lambda entry: entry[0])
    unit = unit_text(case.fit.model.effort_unit)
    change = f"{number(drift.change, drift.standard_error)} ± {number(2.0 * drift.standard_error, digits=2)} {unit}"
    more = f" (and in {len(found) - 1} more)" if len(found) > 1 else ""
    text = (
        f"Friction drifts in recording '{worst.recording}'{more}: by {change} from its start to its end, "
        f"{100 * share:.0f} % of the friction there, as a gear that warms up does."
    )
    yield Verdict("warning", text, "Let the machine warm up before you record, or identify cold and warm apart.")


def _friction_at(values: Mapping[str, float], speed: float) -> float:
    """Return the friction that reported terms give without a load at a speed [rad/s or m/s], in the effort's unit."""
    known = {
        target: abs(values[term.name])
        for term in TERMS
        if term.name in values and term.resists is not None
        for target in term.targets
    }
    return float(largest_friction(model_fields("joint"), known, speed, 0.0)) if known else 0.0
