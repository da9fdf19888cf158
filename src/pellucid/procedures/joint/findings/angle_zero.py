"""An encoder whose zero is not where the joint hangs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import ndtri

from ...._errors import IdentificationError
from ....fit.block_test import SIGNIFICANCE_LEVEL
from ....fit.joint.angle_zero import AngleZero, estimate_angle_zero, has_free_gravity
from ....fit.parameter import Verdict
from ....fit.regression import stack
from ..joint_case import JointCase

SMALLEST = np.radians(3.0)  # below it, gravity and friction that the model misses look the same
SURE = 3.0  # standard errors
COARSE = np.radians(15.0)  # standard error above which no angle is told
HELPS = 1.1  # times the error on held-out effort, that a zero in the wrong place makes
PLAIN = ("symmetric", "directional", "load")  # families that are solved at once


def find(case: JointCase) -> Iterator[Verdict]:
    """The angle that gravity implies, with its interval, and the offset to write."""
    if not has_free_gravity(case.fit.model):
        return
    found = _best(case)
    if found is None or found.standard_error > COARSE or abs(found.angle) < max(SMALLEST, SURE * found.standard_error):
        return
    half = float(np.degrees(ndtri(0.5 + 0.5 * case.level) * found.standard_error))
    at = f"the joint hangs where the encoder says {-np.degrees(found.angle):.1f} ± {half:.1f} deg"
    if case.study.model.gravity == "sine+cosine":
        text = f"The zero of the angle is free, as study.toml asks, and {at}"
        yield Verdict("note", f"{text} ({100 * case.level:g} %).")
        return
    turned = np.cos(found.angle) < 0.0  # then both fits explain as much, one with a weight below zero
    if not turned and not (found.p_value < SIGNIFICANCE_LEVEL and found.before > HELPS * found.after):
        return
    unit = case.fit.model.effort_unit
    yield Verdict(
        "wrong",
        f"The zero of the angle is off: by its weight, {at} ({100 * case.level:g} %). With the zero free, effort that "
        f"was not fitted is predicted to {found.after:.3g} {unit} RMS instead of {found.before:.3g}.",
        f'Write {_offset(case, found.angle)}, or gravity = "sine+cosine" in [model].',
        weight=11.0,
    )


def _best(case: JointCase) -> AngleZero | None:
    """By the family that predicts best with its zero free: one that misses friction finds a coarser angle."""
    held = [m for m in case.excerpt if m.split == "heldout"]
    data = stack([m for m in case.excerpt if m.split == "fitted"])
    made = []
    for fit in [case.fits[n] for n in PLAIN if n in case.fits] or [case.fit]:
        try:
            made.append(estimate_angle_zero(fit.model, data, held))
        except IdentificationError:
            continue  # too small a range of angles to tell
    return min(made, key=lambda each: each.after, default=None)


def _offset(case: JointCase, angle: float) -> str:
    """The entry of [channels] that puts the zero right."""
    spec = case.study.config.channels["position"]
    offset = spec.offset + angle / spec.si_factor
    return f"offset = {offset:.4g} in [channels] position ({spec.unit})"
