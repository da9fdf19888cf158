"""Finding: one held-out recording explains most of the error, and what it may have carried."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ....models.parameter import Verdict
from ...fit.evaluation import Prediction
from ...fit.replay import relative_error
from ..joint_case import JointCase
from ..unstated_payload import PAYLOAD_ADVICE, estimate_without, unstated_payload

MIN_RECORDINGS = 3
"""One recording is named only beside at least two others."""

MAX_REMAINING_SHARE = 2.0 / 3.0
"""One recording explains the error if without it at most this share is left. Chosen by judgement; no measurement is
recorded."""


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
    payload = unstated_payload(*estimate_without(case, ()), odd.recording, case) if case.rotary else None
    if payload is not None:
        text += f" {payload}"
        do = PAYLOAD_ADVICE
    yield Verdict("warning", text, do, weight=8.0)


def _pooled_error(predictions: Sequence[Prediction]) -> float:
    """Return the effort error over all samples [%]."""
    return relative_error(*(np.concatenate([getattr(p, n) for p in predictions]) for n in ("effort", "predicted")))
