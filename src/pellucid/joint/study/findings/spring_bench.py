"""Finding: the effort follows the position as that of a spring does, such as a locked series-elastic element."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ....models.joint import GRAVITY
from ....models.parameter import Verdict
from ....numerics.spring_evidence import (
    MAX_SPRING_UNEXPLAINED_SHARE,
    MIN_EXCESS,
    MIN_LEVER_M,
    STANDARD_ERRORS,
    USUAL_LEVER_M,
)
from ....study.pages.quantities import number, unit_text
from ...fit.evaluation import Prediction
from ...fit.spring_fit import solve_spring
from ..joint_case import JointCase

MIN_UNEXPLAINED_SHARE = 0.5
"""The joint's model fails if it leaves at least this share of the effort's variance."""

MAX_ALIKE_SHARE = 0.01
"""A spring that is taken for a weight leaves at most this share of the effort's variance; over wide angles it leaves
more."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report a spring that the joint's model leaves out, or takes for a weight."""
    fitted = [p for p in case.fit.predictions if p.split == "fitted"]
    if not fitted:
        return
    stiffness, error, left = _spring(fitted)
    size = float(np.sum(np.concatenate([p.effort - p.effort.mean() for p in fitted]) ** 2))
    missed = float(np.sum(np.concatenate([p.effort - p.predicted for p in fitted]) ** 2))
    unit = unit_text("N*m/rad" if case.rotary else "N/m") if case.fit.model.effort_unit in ("N*m", "N") else ""
    said = f"{number(stiffness, error)} ± {number(STANDARD_ERRORS * error, digits=2)} {unit}".rstrip()
    do = 'A spring is no joint of its own: state protocol = "locked_spring" to identify it, or record the joint with '
    do += "its end free."
    if stiffness > 0.0 and missed > MIN_UNEXPLAINED_SHARE * size and left < MAX_SPRING_UNEXPLAINED_SHARE * size:
        text = f"The effort follows the position as that of a spring of {said}, which explains "
        text += f"{100.0 * (1.0 - left / size):.0f} % of its variance; the joint's model explains "
        text += f"{100.0 * max(1.0 - missed / size, 0.0):.0f} %."
        yield Verdict("wrong", text, do, weight=2.0)
        return
    found = {p.name: p for p in case.fit.estimate.parameters}
    if not case.rotary or not {"inertia", "gravity"} <= found.keys() or case.fit.model.effort_unit != "N*m":
        return
    inertia, gravity = found["inertia"], found["gravity"]
    most = inertia.value + STANDARD_ERRORS * inertia.standard_error
    sure = gravity.value > STANDARD_ERRORS * gravity.standard_error
    acceleration = np.concatenate([p.acceleration for p in fitted])
    usual = USUAL_LEVER_M * gravity.value / GRAVITY * float(np.linalg.norm(acceleration))
    shown = usual > MIN_EXCESS * np.sqrt(missed) and left <= MAX_ALIKE_SHARE * size
    if sure and shown and np.isfinite(most) and most * GRAVITY < MIN_LEVER_M * gravity.value:
        text = (
            f"A weight of {number(gravity.value, gravity.standard_error)} {unit_text('N*m')} with an inertia below "
            f"{number(most, digits=2)} {unit_text('kg*m^2')} would hang less than {100 * MIN_LEVER_M:.0f} cm from the "
            f"axis: this is most likely a spring of {said}, which looks like a weight over small angles."
        )
        yield Verdict("warning", text, do, weight=2.0)


def _spring(fitted: Sequence[Prediction]) -> tuple[float, float, float]:
    """Return a spring's stiffness, its standard error, and the squares that it leaves beside damping and friction."""
    parts = []
    for p in fitted:
        one = np.ones_like(p.position)
        parts.append(np.column_stack([p.position, p.acceleration, p.velocity, np.sign(p.velocity), one]))
    columns, effort = np.concatenate(parts), np.concatenate([p.effort for p in fitted])
    solution, covariance, residual = solve_spring(columns, effort, [len(p.effort) for p in fitted])
    error = float(np.sqrt(max(covariance[0, 0], 0.0)))
    return float(solution[0]), error, float(residual @ residual)
