"""A payload that study.toml does not mention, as a tested cause why one recording differs from the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...numerics.regression import regression_rows, stack
from ...numerics.uncertainty import sandwich_covariance
from ...study.pages.quantities import interval_text
from ..fit.unknown_payload import estimate_payload
from .joint_case import JointCase

PAYLOAD_ADVICE = "If it carried one, write payload = {} there to have it found, or state its mass and distance."
"""What to do about a payload that was found and is not stated."""

MIN_WEIGHT_SHARE = 0.05
"""A payload that is not stated is named only if it weighs at least this share of what the joint carries by itself."""


def estimate_without(case: JointCase, recordings: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the joint's values, (p,), and their covariance, (p, p), from fitted recordings without those named."""
    joint = case.fit.estimate
    motions = [m for m in case.excerpt if m.split == "fitted" and m.recording not in recordings]
    if not motions:
        return joint.array, joint.covariance
    data = stack(motions)
    w, effort = regression_rows(joint.model, joint.array, data)
    step = np.linalg.lstsq(w, data.target - effort, rcond=None)[0]
    return joint.array + step, sandwich_covariance(w, data.target - effort - w @ step, data.lengths)


def unstated_payload(values: np.ndarray, covariance: np.ndarray, recording: str, case: JointCase) -> str | None:
    """Return a sentence with the payload that explains a recording; None if none does, or if one is stated there.

    The joint without it has `values`, (p,), with `covariance`, (p, p).
    """
    motions = [m for m in case.excerpt if m.recording == recording]
    if not motions or any(m.payload[0] for m in motions):
        return None
    payload = estimate_payload(case.fit.estimate.model, values, covariance, covariance, motions)
    if payload is None or not payload.is_told:
        return None
    names = case.fit.estimate.model.names
    if payload.weight.value < MIN_WEIGHT_SHARE * abs(float(values[names.index("gravity")])):
        return None
    share = f"{100.0 * payload.explained:.0f} % of what is missed there"
    if not payload.mass.trusted:
        return f"A payload that is not stated explains {share}: {interval_text(payload.weight, case.level)} of weight."
    point = f"{interval_text(payload.mass, case.level)} at {interval_text(payload.distance, case.level)}"
    return f"A payload that is not stated explains {share}: {point}."
