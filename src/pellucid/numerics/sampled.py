"""Arrays as a user has them: of one length, finite, over time that increases; or a message that says what is not."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._errors import RecordingError
from .arguments import real_column

MAX_STEP_DEVIATION_SHARE = 0.05
"""Where samples must be even, a time step may differ from the mean step by at most this share."""


def sampled(where: str, time: Any, *, least: int = 2, even: bool = True, **signals: Any) -> tuple[np.ndarray, ...]:
    """Time [s] and signals as arrays of floats, each of shape (n,), examined. `time` (n,) [s]; `signals` (n,); gives
    (n,)."""
    columns = {name: real_column(where, name, values) for name, values in {"time": time, **signals}.items()}
    t = columns["time"]
    if len(t) < least:
        raise RecordingError(f"{where}: time: found {len(t)} samples, expected at least {least}")
    for name, values in columns.items():
        if len(values) != len(t):
            raise RecordingError(f"{where}: {name}: found {len(values)} samples, expected {len(t)}, as many as times")
        missing = np.flatnonzero(~np.isfinite(values))
        if len(missing):
            raise RecordingError(
                f"{where}: {name}: found {values[missing[0]]} at sample {missing[0]} ({len(missing)} such samples), "
                "expected finite numbers; cut or interpolate them first"
            )
    steps = np.diff(t)
    wrong = np.flatnonzero(~(steps > 0.0))
    if len(wrong):
        i = int(wrong[0])
        raise RecordingError(
            f"{where}: time: found {t[i]:.6g} s, then {t[i + 1]:.6g} s at sample {i + 1} ({len(wrong)} such steps), "
            "expected time that increases with every sample"
        )
    mean = float(t[-1] - t[0]) / max(len(steps), 1)
    if even and np.abs(steps - mean).max() > MAX_STEP_DEVIATION_SHARE * mean:
        raise RecordingError(
            f"{where}: time: found steps of {steps.min():.3g} to {steps.max():.3g} s, expected even ones; "
            "interpolate to an even grid first"
        )
    return tuple(columns.values())

