"""Detect that the strap slipped during a trial, so that the limb rests at another angle in the orthosis afterwards.

A slip is a step in the part of the IMU's angle that the orthosis's motion and the strap's torque do not explain. The
search considers every sample as the time of the step. The step must be significant given the residual's
autocorrelation, and large enough to matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...numerics.filters import central_difference
from .strap_torque import StrappedSwing, StrapTorque

MIN_SLIP_RAD = np.radians(1.5)
"""Steps smaller than this are ignored [rad]."""

MIN_SLIP_STANDARD_ERRORS = 6.0
"""A step must exceed this many standard errors. By chance the largest of hundreds of candidates reaches about 3.5."""

BLOCK_LENGTH_S = 2.5
"""The noise of the residual is estimated from the means of blocks of this length, longer than one swing [s]."""

CLOCK_CORRECTIONS_S = np.arange(-0.15, 0.16, 0.025)
"""Corrections of the IMU's clock that are tried, because the clock was found from two different angles [s]."""

EXCLUDED_END_BLOCKS = 2
"""A step is not searched for in this many blocks at either end of a trial, where it cannot be told from noise."""


@dataclass(frozen=True)
class Slip:
    """A step in the mismatch between limb and orthosis."""

    recording: str  # name of the trial
    time: float  # time of the slip [s]
    step: float  # angle by which the limb turned in the orthosis [rad]


def regression_residual(swing: StrappedSwing, torque: StrapTorque, shift: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the residual of a linear regression of the IMU's angle on motion and strap torque.

    The regression has no memory, so it cannot follow a step, as a strap with much damping and little stiffness could.
    `shift` is the clocks' difference [s]. Returns times and residuals, each of shape (m,) [s], [rad].
    """
    rate = central_difference(torque.torque, swing.fs)
    speed, jerk = central_difference(swing.position, swing.fs), central_difference(rate, swing.fs)
    series = np.column_stack([swing.position, speed, torque.torque, rate, jerk])
    # The clock was found from two angles that differ, so corrections are tried and the best one is used.
    tried = [_residual_at_shift(swing, series, shift + late) for late in CLOCK_CORRECTIONS_S]
    return min(tried, key=lambda pair: float(np.mean(pair[1] ** 2)))


def _residual_at_shift(swing: StrappedSwing, series: np.ndarray, shift: float) -> tuple[np.ndarray, np.ndarray]:
    time = swing.imu_time + shift
    known = np.isfinite(swing.imu_angle) & (time >= swing.time[0]) & (time <= swing.time[-1])
    columns = np.column_stack([np.interp(time[known], swing.time, s) for s in series.T])
    columns = np.column_stack([np.ones(len(columns)), columns / np.maximum(columns.std(axis=0), 1e-12)])
    angle = swing.imu_angle[known]
    return time[known], angle - columns @ np.linalg.lstsq(columns, angle, rcond=None)[0]


def find_slip(recording: str, time: np.ndarray, residual: np.ndarray) -> Slip | None:
    """Return the largest step of a residual, or None if it is not significant. Shapes (m,) [s], [rad]."""
    known = np.isfinite(residual) & np.isfinite(time)
    t, r = time[known], residual[known]
    n = len(r)
    each = _samples_per_block(t)
    first, last = EXCLUDED_END_BLOCKS * each, n - EXCLUDED_END_BLOCKS * each
    if last - first < each:
        return None
    before = np.cumsum(r)[first:last]
    count = np.arange(first + 1, last + 1)
    step = (r.sum() - before) / (n - count) - before / count
    # All candidates have the same noise, so the best one explains the largest sum of squares.
    at = int(np.argmax(step**2 * count * (n - count) / n))
    after = np.arange(n) >= count[at]
    rest = r - np.where(after, r[after].mean(), r[~after].mean())
    # The blocks are longer than a swing and than the sway of a thigh, so their means are nearly independent.
    sides = (rest[~after], rest[after])
    blocks = np.array([b.mean() for side in sides for b in np.array_split(side, len(side) // each)])
    spread = np.sqrt(np.sum(blocks**2) / (len(blocks) - 2))
    share = len(blocks) / n
    error = spread * np.sqrt(1.0 / (share * count[at]) + 1.0 / (share * (n - count[at])))
    if abs(step[at]) < max(MIN_SLIP_RAD, MIN_SLIP_STANDARD_ERRORS * error):
        return None
    return Slip(recording, float(t[count[at]]), float(step[at]))


def _samples_per_block(time: np.ndarray) -> int:
    """Return the number of samples in a block."""
    return max(1, round(BLOCK_LENGTH_S * (len(time) - 1) / max(float(time[-1] - time[0]), 1e-9)))
