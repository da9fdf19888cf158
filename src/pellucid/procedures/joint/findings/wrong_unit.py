"""A fit that fails on an angle in degrees that study.toml calls radians."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...._errors import IdentificationError
from ....fit.joint.angle_zero import has_free_gravity
from ....fit.joint.friction_solver import solve_family
from ....fit.parameter import Verdict
from ....fit.regression import stack
from ....models.joint import JointModel
from ..joint_case import JointCase
from .prediction import FAILED

SAVES = 0.5  # times the error, that the angle read in degrees must not exceed
WIDE = 2.0 * np.pi  # range of an angle [rad] that few joints with a weight have, and any has in degrees


def find(case: JointCase) -> Iterator[Verdict]:
    """That a failed fit is one no more with the angle read in degrees: the sine of the weight tells."""
    # Radians called degrees make no fit fail: weight is proportional to small angles, and inertia takes the factor.
    if not has_free_gravity(case.fit.model) or case.fit.fitted_r2 > FAILED:
        return
    position = case.data.reduced([m.position for m in case.data.motions])
    if np.ptp(position) < WIDE:
        return
    model = case.fits.get("symmetric", case.fit).model
    said, read = _error(case, model, 1.0), _error(case, model, np.pi / 180.0)
    if read < SAVES * said:
        yield Verdict(
            "wrong",
            f"The position looks like degrees declared as radians: read so, the model misses {read:.3g} % of the "
            f"effort instead of {said:.3g} %.",
            'Write unit = "deg" in [channels] position.',
            weight=11.5,
        )


def _error(case: JointCase, model: JointModel, factor: float) -> float:
    """Error of the effort [%] with the motion times a factor; infinite where it cannot be fitted."""
    motions = [
        replace(
            m,
            position=factor * m.position,
            velocity=factor * m.velocity,
            acceleration=factor * m.acceleration,
            filtering=replace(m.filtering, dead_band=factor * m.filtering.dead_band),
        )
        for m in case.data.motions
    ]
    try:
        data = stack(motions)
        residual = solve_family(model, data).residual
    except IdentificationError:
        return float("inf")
    return float(100.0 * np.linalg.norm(residual) / np.linalg.norm(data.target))
