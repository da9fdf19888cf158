"""Did the strap slip in mid-trial? Then the limb rests at another angle in the orthosis from that moment on.

What the orthosis's motion and the strap's torque do not explain of the IMU's angle has a step there. It is looked for
at every moment, and must be larger than what the residual's own colour explains, and than a size that matters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...signals.filters import central_difference
from .strap_torque import StrappedSwing, StrapTorque

SMALLEST = np.radians(1.5)
"""A smaller step is let pass [rad]."""
SURE = 6.0
"""Standard errors that a step must have: the largest of hundreds of candidates is some 3.5 by chance."""
BLOCK = 2.5
"""Length of the blocks whose means tell the residual's slow part from a step [s]."""
LATE = np.arange(-0.15, 0.16, 0.025)
"""By how much a clock may be wrong that was found by comparing two angles [s]."""
ENDS = 2
"""Blocks at either end of a trial in which no step can be told from noise."""


@dataclass(frozen=True)
class Slip:
    """A step in the mismatch: in which trial, when [s], and by how much the limb turned in the orthosis [rad]."""

    recording: str
    time: float
    step: float


def unexplained(swing: StrappedSwing, torque: StrapTorque, shift: float) -> tuple[np.ndarray, np.ndarray]:
    """What a straight regression on motion and strap torque leaves of the IMU's angle.

    It has no memory, so that it cannot follow a step as a strap with much damping and little stiffness would.

    `shift` [s]; gives `time`, `residual` (m,) [s], [rad].
    """
    rate = central_difference(torque.torque, swing.fs)
    series = [swing.position, central_difference(swing.position, swing.fs), torque.torque, rate]
    series = np.column_stack([*series, central_difference(rate, swing.fs)])
    # The clock was found from two angles that are not the same: about it, the one that explains most.
    tried = [_regressed(swing, series, shift + late) for late in LATE]
    return min(tried, key=lambda pair: float(np.mean(pair[1] ** 2)))


def _regressed(swing: StrappedSwing, series: np.ndarray, shift: float) -> tuple[np.ndarray, np.ndarray]:
    time = swing.imu_time + shift
    known = np.isfinite(swing.imu_angle) & (time >= swing.time[0]) & (time <= swing.time[-1])
    columns = np.column_stack([np.interp(time[known], swing.time, s) for s in series.T])
    columns = np.column_stack([np.ones(len(columns)), columns / np.maximum(columns.std(axis=0), 1e-12)])
    angle = swing.imu_angle[known]
    return time[known], angle - columns @ np.linalg.lstsq(columns, angle, rcond=None)[0]


def find_slip(recording: str, time: np.ndarray, residual: np.ndarray) -> Slip | None:
    """The largest step of a residual, if it is one. `time`, `residual` (m,) [s], [rad]."""
    known = np.isfinite(residual) & np.isfinite(time)
    t, r = time[known], residual[known]
    n = len(r)
    each = _each(t)
    first, last = ENDS * each, n - ENDS * each
    if last - first < each:
        return None
    before = np.cumsum(r)[first:last]
    count = np.arange(first + 1, last + 1)
    step = (r.sum() - before) / (n - count) - before / count
    # Each candidate against the same noise: the step that explains most is the one with the largest sum of squares.
    at = int(np.argmax(step**2 * count * (n - count) / n))
    after = np.arange(n) >= count[at]
    rest = r - np.where(after, r[after].mean(), r[~after].mean())
    # Means of blocks longer than a swing, and than a thigh's sway: what is left of the residual's colour.
    sides = (rest[~after], rest[after])
    blocks = np.array([b.mean() for side in sides for b in np.array_split(side, len(side) // each)])
    spread = np.sqrt(np.sum(blocks**2) / (len(blocks) - 2))
    share = len(blocks) / n
    error = spread * np.sqrt(1.0 / (share * count[at]) + 1.0 / (share * (n - count[at])))
    if abs(step[at]) < max(SMALLEST, SURE * error):
        return None
    return Slip(recording, float(t[count[at]]), float(step[at]))


def _each(time: np.ndarray) -> int:
    """Samples of a block."""
    return max(1, round(BLOCK * (len(time) - 1) / max(float(time[-1] - time[0]), 1e-9)))
