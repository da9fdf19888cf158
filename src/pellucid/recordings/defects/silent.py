"""Find efforts that fall silent: a measured torque, force or current that is one value while its joint moves on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .constant import silent_stretch
from .watched import WatchedRecording

KIND = "dead_effort"

MEASURED_DRIVES = ("torque", "force", "current")
"""Channels of drives that a sensor measures; a voltage or a duty may be held."""

MIN_TRAVEL_SHARE = 0.1
"""The joint moves during the silence if it covers this share of its range."""


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for the stretch in which a joint's measured effort is silent while the joint moves."""
    for position, drive in watched.drives.items():
        if drive.partition(".")[0] not in MEASURED_DRIVES or not {position, drive} <= set(watched.channels):
            continue
        effort, place = watched.samples(drive), watched.samples(position)
        stretch = silent_stretch(effort)
        if stretch is None:
            continue
        first, last = stretch
        inside = place[first : last + 1]
        span = float(np.nanmax(place) - np.nanmin(place)) if np.isfinite(place).any() else 0.0
        if np.isfinite(inside).any() and np.nanmax(inside) - np.nanmin(inside) > MIN_TRAVEL_SHARE * span > 0.0:
            unit = watched.recording.channels[drive].unit
            found = f"a dead effort, the one value {effort[first]:.6g} {unit} while the joint moves"
            yield make_cut(watched.recording, KIND, drive, first=first, last=last, found=found)
