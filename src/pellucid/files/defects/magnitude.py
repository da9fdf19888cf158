"""Find values that no wearable machine has: numbers in another unit than stated, or nonsense."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..recording import Channel
from .watched import finite_range

# For each quantity and SI unit: the largest plausible magnitude of a wearable joint, and the unit that is probably
# meant if a value is larger. The magnitudes were chosen by judgement; no measurement is recorded.
_MAX_PLAUSIBLE = {
    ("time", "s"): (1e11, "ms"),  # clocks may count from 1970
    ("position", "rad"): (4 * math.pi, "deg"),
    ("reference", "rad"): (4 * math.pi, "deg"),
    ("position", "m"): (10.0, "mm"),
    ("reference", "m"): (10.0, "mm"),
    ("velocity", "rad/s"): (200.0, "deg/s"),
    ("velocity", "m/s"): (50.0, "mm/s"),
    ("current", "A"): (200.0, "mA"),
    ("voltage", "V"): (1000.0, "mV"),
    ("torque", "N*m"): (1000.0, "N*mm"),
    ("duty", "1"): (1.5, "%"),
}
# The same for surface EMG, which stays below some millivolts at the skin.
_MAX_PLAUSIBLE_EMG = (0.05, "mV")

# Larger numbers of EMG are microvolts: no muscle has so many millivolts.
_MAX_EMG_MV = 20.0


@dataclass(frozen=True)
class MagnitudeLimits:
    """When a magnitude is nonsense, and when a joint turns on and on."""

    # A channel's typical magnitude is this quantile of its absolute values, so that a few wild samples do not
    # count.
    typical_quantile: float = 0.9
    # Shorter recordings do not show whether a joint tumbles.
    min_tumbling_samples: int = 100
    # Half the width of the smoothing before an angle is differentiated [s]. Chosen by judgement.
    tumbling_smoothing_s: float = 0.01
    # The angle is in radians if gravity then leaves at most this share of the variance that it leaves otherwise.
    max_tumbling_residual_share: float = 0.5
    # A stretch of this length is looked at for one speed [s].
    steady_stretch_s: float = 0.5
    # A stretch has one speed if the angle stays within this share of its way of a straight line (RMS).
    max_steady_deviation_share: float = 0.01
    # A recording is one of constant speeds if this share of the time in which the joint moves is of such stretches.
    min_steady_share: float = 0.8
    # A unit is guessed only for magnitudes up to this one in SI. Larger numbers are no measurement in another unit.
    max_guessed_magnitude: float = 1e4
    # Largest plausible magnitude in SI units of a channel that has no bound of its own. Chosen by judgement.
    max_magnitude: float = 1e9
    # A position that moves this many times as far as its reference, or as little, has another unit or ratio than it.
    # Chosen by judgement: no loop that follows its reference is that far off, and no two units of an angle or a length
    # that are confused are closer than mm and cm.
    min_unit_factor: float = 8.0
    # Smallest correlation of a position with its reference, and number of samples, at which they are compared.
    min_following: float = 0.95
    min_compared_samples: int = 100


MAGNITUDE_LIMITS = MagnitudeLimits()


@dataclass(frozen=True)
class ImplausibleMagnitude:
    """A channel's largest magnitude, which no machine has."""

    largest: float  # largest magnitude of the channel [SI]
    limit: float  # largest plausible magnitude [SI]
    probable_unit: str  # unit in which the numbers seem to be; "" if no unit fits
    is_typical: bool  # whether the typical magnitude is above a tenth of the limit


def find_implausible(channel: Channel, known_limit: float = 0.0) -> ImplausibleMagnitude | None:
    """Return the magnitude of a channel if it is implausible, else None; a larger `known_limit` [SI] is plausible."""
    samples = channel.samples
    low, high = finite_range(samples)
    largest = max(-low, high, 0.0)
    limit, probable_unit = _MAX_PLAUSIBLE.get(
        (channel.name.partition(".")[0], channel.unit), (MAGNITUDE_LIMITS.max_magnitude, "")
    )
    if channel.name.startswith("emg.") and channel.unit == "V":
        limit, probable_unit = _MAX_PLAUSIBLE_EMG
        if largest > _MAX_EMG_MV:
            probable_unit = "uV"
    limit = max(limit, known_limit)
    if largest <= limit:
        return None
    if largest > MAGNITUDE_LIMITS.max_guessed_magnitude and channel.name != "time":
        probable_unit = ""
    magnitudes = np.abs(samples[np.isfinite(samples)][:: max(1, len(channel) // 200_000)])
    is_typical = bool(np.quantile(magnitudes, MAGNITUDE_LIMITS.typical_quantile) > 0.1 * limit)
    return ImplausibleMagnitude(largest, limit, probable_unit, is_typical)


def wrong_ratio(position: np.ndarray, reference: np.ndarray) -> float | None:
    """Return how many times as far as its reference a position moves, if that is far too much or too little.

    Both have shape (n,) and the same unit; NaN is no reading. None where nothing is wrong, or where the position does
    not follow the reference.
    """
    known = np.isfinite(position) & np.isfinite(reference)
    if np.count_nonzero(known) < MAGNITUDE_LIMITS.min_compared_samples:
        return None
    q, wanted = position[known], reference[known]
    sizes = float(np.std(q)), float(np.std(wanted))
    if not min(sizes) > 0.0 or not np.corrcoef(q, wanted)[0, 1] >= MAGNITUDE_LIMITS.min_following:
        return None
    ratio = sizes[0] / sizes[1]
    return None if 1.0 / MAGNITUDE_LIMITS.min_unit_factor < ratio < MAGNITUDE_LIMITS.min_unit_factor else ratio


def has_constant_speeds(time: np.ndarray, angle: np.ndarray) -> bool:
    """Whether a joint turns at one speed or at several, each for a while, as on a dynamometer or for a friction map.

    Parameters
    ----------
    time, angle : ndarray, shape (n,) each
        Even time [s] and angle [rad].
    """
    known = np.isfinite(time) & np.isfinite(angle)
    time, angle = time[known], angle[known]
    length = round(MAGNITUDE_LIMITS.steady_stretch_s / float(np.median(np.diff(time)))) if len(time) > 1 else 0
    if length < 5 or len(angle) < 4 * length:
        return False
    stretches = angle[: len(angle) // length * length].reshape(-1, length)
    unit = np.linspace(-1.0, 1.0, length)
    slope = stretches @ unit / float(unit @ unit)
    off = stretches - stretches.mean(axis=1, keepdims=True) - slope[:, None] * unit
    way = 2.0 * np.abs(slope)
    moving = way > 0.01 * float(np.max(way, initial=0.0))
    straight = np.sqrt(np.mean(off**2, axis=1)) <= MAGNITUDE_LIMITS.max_steady_deviation_share * way
    return bool(moving.any()) and float(np.mean(straight[moving])) >= MAGNITUDE_LIMITS.min_steady_share


def is_tumbling(time: np.ndarray, angle: np.ndarray, effort: np.ndarray) -> bool:
    """Whether gravity says that `angle` is in radians, because a joint turns on and on, and not in degrees.

    Gravity repeats with every turn. Inertia, effort, friction and the sine of the angle explain the acceleration if
    the angle is in the right unit.

    Parameters
    ----------
    time, angle, effort : ndarray, shape (n,) each
        Time [s], the angle as it was read, and what drives the joint, in any unit.
    """
    known = np.isfinite(time) & np.isfinite(angle) & np.isfinite(effort)
    time, angle, effort = time[known], angle[known], effort[known]
    if len(time) < MAGNITUDE_LIMITS.min_tumbling_samples or np.any(np.diff(time) <= 0.0):
        return False
    width = max(1, round(MAGNITUDE_LIMITS.tumbling_smoothing_s / float(np.median(np.diff(time)))))
    kernel = np.ones(2 * width + 1) / (2 * width + 1)
    for _ in range(2):
        angle, effort = (np.convolve(np.pad(x, width, mode="edge"), kernel, mode="valid") for x in (angle, effort))
    speed = np.gradient(angle, time)
    acceleration = np.gradient(speed, time)
    inner = slice(4 * width, len(time) - 4 * width)
    left = {}
    for unit, factor in (("rad", 1.0), ("deg", math.pi / 180.0), ("none", 0.0)):
        columns = (effort, speed, np.sign(speed), np.sin(factor * angle), np.cos(factor * angle))
        design = np.column_stack([*columns, np.ones(len(time))])[inner]
        solution = np.linalg.lstsq(design, acceleration[inner], rcond=1e-10)[0]
        left[unit] = float(np.mean((acceleration[inner] - design @ solution) ** 2))
    return left["rad"] < MAGNITUDE_LIMITS.max_tumbling_residual_share * min(left["deg"], left["none"])
