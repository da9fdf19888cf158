"""Find which column is the effort of which motion, and whether an angle is in degrees by how it is weighed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MIN_EFFORT_SHARE = 0.25
"""A column is a joint's effort if the joint's motion explains at least this share of its variance."""

MIN_GRAVITY_GAIN = 0.05
"""One unit of an angle is decided by weight if its sine explains this share of the effort more than the other
unit's."""

MAX_ROWS = 4_000
"""Fits take at most this many rows, evenly spread."""


@dataclass(frozen=True)
class MotionSamples:
    """Position, velocity and acceleration of one joint in its own units, smoothed alike, each shape (n,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    width: int  # rows over which running means were taken


def motion_samples(position: np.ndarray, time: np.ndarray) -> MotionSamples:
    """Return a joint's motion from positions, shape (n,), at times that do not fall [s]."""
    rate = len(time) / max(float(time[-1] - time[0]), 1e-9)
    width = max(1, min(round(rate / 25.0), len(time) // 50))
    smooth = running_mean(position, width)
    grid = np.arange(len(smooth)) / rate
    velocity = np.gradient(smooth, grid)
    return MotionSamples(smooth, velocity, np.gradient(velocity, grid), width)


def running_mean(values: np.ndarray, width: int) -> np.ndarray:
    """Return running means over `width` rows, three times, with the ends repeated, shape (n,)."""
    known = np.nan_to_num(values, nan=float(np.nanmedian(values)))
    if width <= 1:
        return known
    for _ in range(3):
        padded = np.concatenate((np.full(width // 2, known[0]), known, np.full(width - 1 - width // 2, known[-1])))
        sums = np.cumsum(np.concatenate(([0.0], padded)))
        known = (sums[width:] - sums[:-width]) / width
    return known


def effort_share(effort: np.ndarray, motion: MotionSamples, radians_per_unit: float | None) -> float:
    """Return the share of an effort's variance, shape (n,), that a joint's motion explains.

    Inertia, both kinds of friction and a constant explain it, and gravity where `radians_per_unit` is given.
    """
    target = running_mean(effort, motion.width)
    columns = [
        motion.acceleration,
        motion.velocity,
        np.tanh(motion.velocity / _usual(motion.velocity)),
        np.ones(len(target)),
    ]
    if radians_per_unit is not None:
        columns += [np.sin(motion.position * radians_per_unit), np.cos(motion.position * radians_per_unit)]
    rows = slice(None, None, max(1, len(target) // MAX_ROWS))
    matrix = np.column_stack(columns)[rows]
    scales = np.linalg.norm(matrix, axis=0)
    matrix, target = matrix / np.where(scales > 0.0, scales, 1.0), target[rows]
    power = float(np.sum((target - target.mean()) ** 2))
    if power <= 0.0:
        return 0.0
    answer = np.linalg.lstsq(matrix, target, rcond=None)[0]
    return 1.0 - float(np.sum((target - matrix @ answer) ** 2)) / power


def unit_by_weight(effort: np.ndarray, motion: MotionSamples) -> tuple[str, float, float] | None:
    """Return ``"deg"`` or ``"rad"`` by which sine of the angle weighs the joint better, and both explained shares.

    None if neither is clearly better: little motion, or no gravity, cannot decide.
    """
    degrees = effort_share(effort, motion, np.pi / 180.0)
    radians = effort_share(effort, motion, 1.0)
    span = float(np.ptp(motion.position))
    if max(degrees, radians) < MIN_EFFORT_SHARE:
        return None
    # Degrees taken for radians turn many times, radians taken for degrees hardly bend: the better one has to be plain.
    if degrees - radians > MIN_GRAVITY_GAIN and span > 20.0:
        return "deg", degrees, radians
    if radians - degrees > MIN_GRAVITY_GAIN and 0.5 < span < 15.0:
        return "rad", degrees, radians
    return None


def _usual(values: np.ndarray) -> float:
    return float(np.quantile(np.abs(values), 0.3)) or float(np.max(np.abs(values))) or 1.0
