"""Finding: parameters change within recordings, as a warming drive or a drifting sensor makes them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....models.parameter import Verdict
from ..joint_case import JointCase

SCALED_BY_THE_GAIN = ("gravity", "inertia")
"""Parameters that change by the same share where the gain of a drive or a torque sensor drifts."""

MAX_SHARE_DIFFERENCE_ERRORS = 3.0
"""Two shares are the same if they differ by at most this many standard errors of their difference."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the parameters that drift, by how much, and what their intervals make of it."""
    estimate = case.fit.estimate
    drift = estimate.drift
    if drift is None or not drift.is_told.any():
        return
    shares: dict[str, tuple[float, float]] = {}
    for name, change, error in zip(drift.names, drift.change, drift.standard_error, strict=True):
        value = abs(estimate[name].value)
        if value > 0.0 and np.isfinite(error):
            shares[name] = 100.0 * float(change) / value, 100.0 * float(error) / value
    told = [name for name, is_told in zip(drift.names, drift.is_told, strict=True) if is_told and name in shares]
    if not told:
        return
    said = ", ".join(
        f"{name.replace('_', ' ')} by {shares[name][0]:+.2g} ± {2.0 * shares[name][1]:.1g} %" for name in told
    )
    text = (
        f"Parameters change from the start of a recording to its end: {said} (twice the standard error). Allowing for "
        f"it saves {100.0 * drift.improvement:.2g} % of the error on blocks left out. Intervals contain the drift."
    )
    gained = [shares[name] for name in SCALED_BY_THE_GAIN if name in shares]
    if "gravity" in told and len(gained) == len(SCALED_BY_THE_GAIN):
        (one, error), (other, other_error) = gained
        if abs(one - other) <= MAX_SHARE_DIFFERENCE_ERRORS * float(np.hypot(error, other_error)):
            text += " Inertia changes as gravity does: a drifting gain of drive or torque sensor explains that."
    do = "Let machine, drive and sensors warm up before you record, or identify the parts of the recording apart."
    yield Verdict("warning", text, do)
