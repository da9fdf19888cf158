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

MAX_RAMP_STEP_RATIO = 3.0
"""No change between two samples of a ramp is larger than this many times the median change. A larger one is a jump.
Chosen by judgement."""


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
        if _is_ramp_to_breakaway(effort, place, first, last):
            continue
        inside = place[first : last + 1]
        span = float(np.nanmax(place) - np.nanmin(place)) if np.isfinite(place).any() else 0.0
        if np.isfinite(inside).any() and np.nanmax(inside) - np.nanmin(inside) > MIN_TRAVEL_SHARE * span > 0.0:
            unit = watched.recording.channels[drive].unit
            found = f"a dead effort, the one value {effort[first]:z.6g} {unit} while the joint moves"
            yield make_cut(watched.recording, KIND, drive, first=first, last=last, found=found)


def _is_ramp_to_breakaway(effort: np.ndarray, place: np.ndarray, first: int, last: int) -> bool:
    """Return whether an effort, (n,), is a ramp that a joint at rest is tested with, and that then holds its value.

    Before and after the stretch from `first` to `last`, such an effort only rises or only falls, without a jump to the
    value that it holds, and the joint covers less than `MIN_TRAVEL_SHARE` of its range. An effort that was measured
    while a joint moves turns round again and again, and a sensor at rest shows noise.
    """
    span = float(np.nanmax(place) - np.nanmin(place)) if np.isfinite(place).any() else 0.0
    # The first and the last sample of the stretch belong to the ramps, so that a jump to the held value shows.
    for part in (slice(0, first + 1), slice(last, len(effort))):
        here, steps = place[part], np.diff(effort[part])
        if not steps.size:
            continue
        if not np.isfinite(steps).all() or not ((steps >= 0.0).all() or (steps <= 0.0).all()):
            return False
        moved = np.abs(steps[steps != 0.0])
        if moved.size and moved.max() > MAX_RAMP_STEP_RATIO * np.median(moved):
            return False
        if np.isfinite(here).any() and np.nanmax(here) - np.nanmin(here) > MIN_TRAVEL_SHARE * span:
            return False
    return True
