"""Find values that no wearable machine has: numbers in another unit than stated, or nonsense."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..recording import Channel

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

TYPICAL_QUANTILE = 0.9
"""A channel's typical magnitude is this quantile of its absolute values, so that a few wild samples do not count."""

MAX_GUESSED_MAGNITUDE = 1e4
"""A unit is guessed only for magnitudes up to this one in SI. Larger numbers are no measurement in another unit."""

MAX_MAGNITUDE = 1e9
"""Largest plausible magnitude in SI units of a channel that has no bound of its own. Chosen by judgement."""


@dataclass(frozen=True)
class ImplausibleMagnitude:
    """A channel's largest magnitude, which no machine has."""

    largest: float  # largest magnitude of the channel [SI]
    limit: float  # largest plausible magnitude [SI]
    probable_unit: str  # unit in which the numbers seem to be; "" if no unit fits
    is_typical: bool  # whether the typical magnitude is above a tenth of the limit


def find_implausible(channel: Channel, known_limit: float = 0.0) -> ImplausibleMagnitude | None:
    """Return the magnitude of a channel if it is implausible, else None; a larger `known_limit` [SI] is plausible."""
    limit, probable_unit = _MAX_PLAUSIBLE.get((channel.name.partition(".")[0], channel.unit), (MAX_MAGNITUDE, ""))
    if channel.name.startswith("emg."):
        limit, probable_unit = _MAX_PLAUSIBLE_EMG
    limit = max(limit, known_limit)
    finite = np.isfinite(channel.samples)
    largest = float(np.max(np.abs(channel.samples), where=finite, initial=0.0))
    if largest <= limit:
        return None
    if largest > MAX_GUESSED_MAGNITUDE and channel.name != "time":
        probable_unit = ""
    magnitudes = np.abs(channel.samples[finite][:: max(1, len(channel) // 200_000)])
    is_typical = bool(np.quantile(magnitudes, TYPICAL_QUANTILE) > 0.1 * limit)
    return ImplausibleMagnitude(largest, limit, probable_unit, is_typical)
