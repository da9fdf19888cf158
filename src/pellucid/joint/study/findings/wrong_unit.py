"""Finding: the angle is recorded in degrees although study.toml states radians."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...._errors import IdentificationError
from ....models.joint import JointModel
from ....models.parameter import Verdict
from ....numerics.regression import stack
from ...fit.angle_zero import has_free_gravity
from ...fit.friction_solver import solve_family
from ..joint_case import JointCase
from .prediction import FAILED_R2

MAX_ERROR_RATIO = 0.5
"""The unit is wrong only if reading the angle in degrees reduces the error to at most this share."""

MIN_SUSPICIOUS_RANGE_RAD = 2.0 * np.pi
"""Smallest range of motion that suggests degrees [rad]. Few joints with a weight have such a range in radians."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report a failed fit that succeeds with the angle read in degrees; the sine in gravity makes the difference."""
    # Radians stated as degrees cannot be detected: gravity is linear at small angles, and inertia absorbs the factor.
    if not has_free_gravity(case.fit.model) or case.fit.fitted_r2 > FAILED_R2:
        return
    position = case.data.reduced([m.position for m in case.data.motions])
    if np.ptp(position) < MIN_SUSPICIOUS_RANGE_RAD:
        return
    model = case.fits.get("symmetric", case.fit).model
    error_in_radians, error_in_degrees = _error(case, model, 1.0), _error(case, model, np.pi / 180.0)
    if error_in_degrees < MAX_ERROR_RATIO * error_in_radians:
        yield Verdict(
            "wrong",
            f"The position looks like degrees declared as radians: read so, the model misses {error_in_degrees:.3g} % "
            f"of the effort instead of {error_in_radians:.3g} %.",
            'Write unit = "deg" in [channels] position.',
            weight=11.5,
        )


def _error(case: JointCase, model: JointModel, factor: float) -> float:
    """Return the effort error [%] with the motion multiplied by a factor; infinite if it cannot be fitted."""
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
