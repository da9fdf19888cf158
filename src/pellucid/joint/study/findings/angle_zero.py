"""Finding: the encoder's zero is not where the joint hangs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import ndtri

from ...._errors import IdentificationError
from ....models.parameter import Verdict
from ....numerics.block_test import SIGNIFICANCE_LEVEL
from ....numerics.regression import stack
from ...fit.angle_zero import AngleZero, estimate_angle_zero, has_free_gravity
from ..joint_case import JointCase

MIN_ZERO_ERROR_RAD = np.radians(3.0)
"""Smallest zero error that is reported [rad]. Smaller ones cannot be told from errors of the friction model."""

MIN_STANDARD_ERRORS = 3.0
"""A zero error is reported only if it differs from 0 by more than this many standard errors."""

MAX_STANDARD_ERROR_RAD = np.radians(15.0)
"""No angle is reported if its standard error exceeds this [rad]."""

MIN_ERROR_REDUCTION = 1.1
"""A zero error is reported only if correcting it reduces the effort error by at least this factor."""

TRIED_FAMILIES = ("symmetric", "directional", "load")
"""Families that are solved fast enough to be tried with a free zero."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the zero error that gravity implies, with its interval, and the offset to write."""
    if not has_free_gravity(case.fit.model):
        return
    found = _best(case)
    if (
        found is None
        or found.standard_error > MAX_STANDARD_ERROR_RAD
        or abs(found.angle) < max(MIN_ZERO_ERROR_RAD, MIN_STANDARD_ERRORS * found.standard_error)
    ):
        return
    half = float(np.degrees(ndtri(0.5 + 0.5 * case.level) * found.standard_error))
    at = f"the joint hangs where the encoder says {-np.degrees(found.angle):.1f} ± {half:.1f} deg"
    if case.study.model.gravity == "sine+cosine":
        text = f"The zero of the angle is free, as study.toml asks, and {at}"
        yield Verdict("note", f"{text} ({100 * case.level:g} %).")
        return
    turned = np.cos(found.angle) < 0.0  # both zeros then fit equally well, one of them with a negative weight
    if not turned and not (found.p_value < SIGNIFICANCE_LEVEL and found.before > MIN_ERROR_REDUCTION * found.after):
        return
    unit = case.fit.model.effort_unit
    yield Verdict(
        "wrong",
        f"The zero of the angle is off: by its weight, {at} ({100 * case.level:g} %). With the zero free, effort that "
        f"was not fitted is predicted to {found.after:.3g} {unit} RMS instead of {found.before:.3g}.",
        f"Write {_advice(case, found.angle)} in [model].",
        weight=11.0,
    )


def _best(case: JointCase) -> AngleZero | None:
    """Return the zero error by the family that predicts best with a free zero."""
    data = stack([m for m in case.excerpt if m.split == "fitted"])
    made = []
    for fit in [case.fits[n] for n in TRIED_FAMILIES if n in case.fits] or [case.fit]:
        try:
            made.append(estimate_angle_zero(fit.model, data))
        except IdentificationError:
            continue  # the range of angles is too small
    return min(made, key=lambda each: each.after, default=None)


def _advice(case: JointCase, angle: float) -> str:
    """Return the entries of study.toml that correct the zero; an integrated velocity has no offset to write."""
    free = 'gravity = "sine+cosine"'
    spec = case.study.config.channels.get("position")
    if spec is None:
        return free
    offset = spec.offset + angle / spec.si_factor
    return f"offset = {offset:.4g} in [channels] position ({spec.unit}), or {free}"
