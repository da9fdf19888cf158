"""Find the faults of a trial's motion capture: lost markers, a clock that runs back, a wrong unit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .defects.watched import find_runs
from .fault import Fault
from .readers.read import find_lost_end
from .recording import Recording


@dataclass(frozen=True)
class MarkerLimits:
    """When markers are not fit to be used."""

    # At least this many frames must see the carriage's marker. They last about a second and average the noise to a
    # tenth.
    min_frames: int = 200
    # At least this share of the frames must see the carriage's marker. Chosen by judgement; no measurement is
    # recorded.
    min_seen_share: float = 0.25
    # A marker that is lost for longer than this [s] is reported. Motion captures often lose a marker for shorter
    # times.
    max_unreported_loss_s: float = 0.1
    # Largest plausible coordinate of a marker in a room [m]. Larger values are millimetres read as metres.
    max_coordinate_m: float = 20.0
    # If no coordinate of any marker is larger than this [m], metres were read as millimetres.
    min_largest_coordinate_m: float = 0.02
    # The motion capture should cover at least this share of the recording. Chosen by judgement; no measurement is
    # recorded.
    min_overlap_share: float = 0.5


MARKER_LIMITS = MarkerLimits()


def find_optical_faults(recording: Recording) -> list[Fault]:
    """Return the faults of the motion capture's file that belongs to a recording."""
    optical = recording.optical
    if optical is None:
        return []
    faults: list[Fault] = []

    def add(severity: str, kind: str, channel: str, *, found: str, expected: str) -> None:
        what = "time" if channel == "time" else f"marker {channel}"
        message = f"{optical.path.name} (recording {recording.name}), {what}: found {found}, expected {expected}"
        faults.append(Fault(severity, kind, optical.path.name, channel, found, expected, message))

    lost = find_lost_end(optical.path)
    if lost:
        add("cut", "truncated", "time", found=lost, expected="a whole file; the incomplete part is excluded")
    for marker in optical.markers:
        _check_seen(optical, marker, add)
    if _check_optical_time(optical, add):
        _check_overlap(recording, add)
    _check_room(optical, add)
    return faults


def _check_seen(optical, marker, add) -> None:
    seen, n = optical.seen(marker), len(optical)
    count = int(seen.sum())
    # Only the carriage's marker is needed. The others locate the axis, for which other recordings serve as well.
    needed = marker == optical.carriage
    least = max(MARKER_LIMITS.min_frames, math.ceil(MARKER_LIMITS.min_seen_share * n)) if needed else 1
    if count < least:
        wanted = f"{f'at least {least}' if needed else 'some'}: a column of another name, or a marker that was hidden"
        severity = "refuse" if needed else "note"
        add(severity, "lost_marker", marker, found=f"it in {count} of {n} frames", expected=wanted)
        return
    starts, lengths = find_runs(~seen)
    if starts.size == 0 or not np.isfinite(optical.time).all():
        return
    ends = np.minimum(starts + lengths, n - 1)
    longest = int(np.argmax(optical.time[ends] - optical.time[starts]))
    lasted = float(optical.time[ends[longest]] - optical.time[starts[longest]])
    if lasted > MARKER_LIMITS.max_unreported_loss_s:
        begun = optical.time[starts[longest]]
        found = f"it lost in {int(lengths.sum())} of {n} frames, the longest loss {lasted:.3g} s after {begun:.6g} s"
        add("note", "lost_marker", marker, found=found, expected="it in every frame; frames without it are excluded")


def _check_optical_time(optical, add) -> bool:
    time = optical.time
    missing = int(np.sum(~np.isfinite(time)))
    if missing or len(time) < 2:
        kind = "missing_samples" if missing else "too_few_samples"
        found = f"{missing} missing samples (NaN)" if missing else f"{len(time)} frame"
        add("refuse", kind, "time", found=found, expected="a time for every frame")
        return False
    back = np.flatnonzero(np.diff(time) <= 0)
    if back.size:
        i = int(back[0])
        found = f"{time[i]:.6g} s, then {time[i + 1]:.6g} s at index {i + 1}, {back.size} such steps in all"
        add("refuse", "time_order", "time", found=found, expected="time that increases with every frame")
        return False
    return True


def _check_overlap(recording, add) -> None:
    robot, optical = recording.time, recording.optical.time
    if not np.isfinite(robot).all() or robot[-1] <= robot[0]:
        return
    common = min(robot[-1], optical[-1]) - max(robot[0], optical[0])
    if common >= MARKER_LIMITS.min_overlap_share * (robot[-1] - robot[0]):
        return
    found = f"{optical[0]:.4g} s to {optical[-1]:.4g} s"
    theirs = f"the recording's {robot[0]:.4g} s to {robot[-1]:.4g} s"
    if common <= 0:
        add("refuse", "overlap", "time", found=found, expected=f"some of {theirs}: clocks that start together")
    else:
        add("note", "overlap", "time", found=found, expected=f"most of {theirs}")


def _check_room(optical, add) -> None:
    largest = {m: float(np.nanmax(np.abs(p))) for m, p in optical.markers.items() if optical.seen(m).any()}
    if not largest:
        return
    farthest = max(largest, key=lambda marker: largest[marker])
    value = largest[farthest]
    if value > MARKER_LIMITS.max_coordinate_m:
        found = f"a coordinate of {value:.4g} m, which looks like mm taken for m"
        wanted = f"at most {MARKER_LIMITS.max_coordinate_m:g} m: the unit [optical] states"
        add("refuse", "magnitude", farthest, found=found, expected=wanted)
    elif value < MARKER_LIMITS.min_largest_coordinate_m:
        found = f"no coordinate of any marker beyond {value:.4g} m, which looks like m taken for mm"
        wanted = f"markers farther apart than {MARKER_LIMITS.min_largest_coordinate_m:g} m: the unit"
        add("refuse", "magnitude", farthest, found=found, expected=wanted)
