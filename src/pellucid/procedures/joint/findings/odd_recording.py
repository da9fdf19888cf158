"""Finding: one held-out recording explains most of the error, and what it may have carried."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ....fit.joint.evaluation import Prediction
from ....fit.joint.replay import relative_error
from ....fit.parameter import Verdict
from ....models.joint import GRAVITY
from ..joint_case import JointCase

MIN_RECORDINGS = 3
"""One recording is named only beside at least two others."""

MAX_REMAINING_SHARE = 2.0 / 3.0
"""One recording explains the error if without it at most this share is left. Chosen by judgement; no measurement is
recorded."""

MIN_PAYLOAD_SHARE = 0.5
"""An unstated payload is named if inertia and weight alone explain at least this share of what is missed."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the held-out recording that explains the pooled error, and whether a payload explains it."""
    held = [p for p in case.fit.headline.predictions if p.split == "heldout"]
    if len(held) < MIN_RECORDINGS:
        return
    whole = _pooled_error(held)
    left = {p.recording: _pooled_error([other for other in held if other is not p]) for p in held}
    odd = min(held, key=lambda p: left[p.recording])
    if left[odd.recording] > MAX_REMAINING_SHARE * whole:
        return
    text = f"Recording '{odd.recording}' explains the held-out error: {odd.effort_error:.3g} % there, "
    text += f"{left[odd.recording]:.3g} % over the others, {whole:.3g} % over all."
    do = "Look what was different in it: a payload, another machine or setting, warmth."
    payload = _payload(odd) if case.rotary and case.fit.model.effort_unit == "N*m" else None
    if payload is not None:
        mass, distance = payload
        text += f" A payload that is not stated explains it: {mass:.2g} kg at {distance:.2g} m would."
        do = f'If it carried one, write payload = {{ mass = "{mass:.2g} kg", distance = "{distance:.2g} m" }} there.'
    yield Verdict("warning", text, do, weight=8.0)


def _pooled_error(predictions: Sequence[Prediction]) -> float:
    """Return the effort error over all samples [%]."""
    return relative_error(*(np.concatenate([getattr(p, n) for p in predictions]) for n in ("effort", "predicted")))


def _payload(found: Prediction) -> tuple[float, float] | None:
    """Return the mass [kg] and distance [m] of a point mass that explains what is missed; None if none does."""
    columns = np.column_stack([found.acceleration, np.sin(found.position), np.ones(len(found.time))])
    (inertia, weight, offset), *_ = np.linalg.lstsq(columns, found.residual, rcond=None)
    missed = found.residual - found.residual.mean()
    remaining = found.residual - columns @ (inertia, weight, offset)
    explained = 1.0 - float(remaining @ remaining) / max(float(missed @ missed), np.finfo(float).tiny)
    if explained < MIN_PAYLOAD_SHARE or inertia <= 0.0 or weight <= 0.0:
        return None
    distance = float(inertia * GRAVITY / weight)
    return float(weight / (GRAVITY * distance)), distance
