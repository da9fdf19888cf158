"""Values that no wearable machine has: a unit taken for another, or nonsense."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..recording import Channel

# Largest SI magnitude of a wearable joint, and the unit whose numbers pass it when they are taken for SI.
_PLAUSIBLE = {
    ("time", "s"): (1e11, "ms"),  # Clocks may count from 1970
    ("position", "rad"): (4 * math.pi, "deg"),
    ("reference", "rad"): (4 * math.pi, "deg"),
    ("position", "m"): (10.0, "mm"),
    ("reference", "m"): (10.0, "mm"),
    ("velocity", "rad/s"): (200.0, "deg/s"),
    ("velocity", "m/s"): (50.0, "mm/s"),
    ("current", "A"): (200.0, "mA"),
    ("voltage", "V"): (1000.0, "mV"),
    ("torque", "N*m"): (2000.0, "N*mm"),
    ("duty", "1"): (1.5, "%"),
}
_EMG_PLAUSIBLE = (0.05, "mV")

USUAL = 0.9
"""Share of the samples within which a magnitude is the channel's own, and not that of a few."""

NONSENSE = 1e9
"""SI magnitude that no channel of a machine reaches."""


@dataclass(frozen=True)
class Implausible:
    """A channel whose values no machine has."""

    largest: float  # SI
    limit: float  # SI
    looks: str  # Unit that its numbers seem to be in; "" where they are of none
    usual: bool  # Whether most of its samples are beyond a tenth of the limit


def implausible(channel: Channel, known: float = 0.0) -> Implausible | None:
    """What of a channel is beyond what machines have, or beyond a `known` limit where that is larger [SI]."""
    limit, looks = _PLAUSIBLE.get((channel.name.partition(".")[0], channel.unit), (NONSENSE, ""))
    if channel.name.startswith("emg."):
        limit, looks = _EMG_PLAUSIBLE
    limit = max(limit, known)
    finite = np.isfinite(channel.samples)
    largest = float(np.max(np.abs(channel.samples), where=finite, initial=0.0))
    if largest <= limit:
        return None
    every = np.abs(channel.samples[finite][:: max(1, len(channel) // 200_000)])
    return Implausible(largest, limit, looks, bool(np.quantile(every, USUAL) > 0.1 * limit))
