"""Tell a joint at rest from an encoder that fails: ask the recorded velocity, the other joints and the reference."""

from __future__ import annotations

import numpy as np

from .scale import Scale
from .watched import WatchedRecording, joint_ending

MAX_REST_SPEED_SHARE = 0.05
"""A recorded velocity is at rest while it stays below this share of its usual largest value."""

REST_QUANTA = 2.0
"""A signal is also at rest while it stays within this many times its resolution."""

EDGE_SAMPLES = 2
"""Number of samples at either end of a rest that are not asked."""

MAX_REST_ERROR_SHARE = 0.1
"""A reference asks for the rest if it stays within this share of the position's range from it."""


def is_at_rest(watched: WatchedRecording, position: str, first: int, last: int) -> bool:
    """Whether other channels say that a joint rests in samples `first` to `last`, in which its position is flat.

    A recorded velocity decides, if there is one. Otherwise all other joints rest at the same time, or the reference
    does where the position is.
    """
    channels, ending = watched.recording.channels, joint_ending(position)
    # A sample at either end may belong to the motion: velocities are smoothed over neighbours.
    inside = slice(first + EDGE_SAMPLES, max(last + 1 - EDGE_SAMPLES, first + EDGE_SAMPLES + 1))
    velocity = f"velocity{ending}"
    if velocity in channels and np.nanmax(np.abs(channels[velocity].samples), initial=0.0) > 0.0:
        v = channels[velocity].samples
        # A drive that computes the velocity from its encoder says zero for a failed one as well.
        usual = float(np.nanquantile(np.abs(v), 0.99))
        allowed = max(MAX_REST_SPEED_SHARE * usual, REST_QUANTA * Scale(v).resolution)
        return bool(np.nanmax(np.abs(v[inside]), initial=0.0) <= allowed)
    others = [
        n for n in channels if n.partition(".")[0] in ("position", "motor_position") and joint_ending(n) != ending
    ]
    moving = [channels[n].samples for n in others if np.nanmax(channels[n].samples) > np.nanmin(channels[n].samples)]
    if moving and all(np.ptp(x[inside]) <= REST_QUANTA * Scale(x).resolution for x in moving):
        return True
    reference = watched.reference(position)
    if reference is not None:
        r, q = reference.samples, channels[position].samples
        span = max(float(np.nanmax(q) - np.nanmin(q)), 1e-300)
        still = np.ptp(r[inside]) <= REST_QUANTA * Scale(r).resolution
        return bool(still and np.nanmax(np.abs(r[inside] - q[inside])) <= MAX_REST_ERROR_SHARE * span)
    return False


MAX_BRAKED_SHARE = 0.6
"""A motion brakes before a rest if the last samples before it move by at most this share of those before them. The peak
of a smooth motion that is cut off moves by at least 0.8 of it."""


def comes_to_rest(x: np.ndarray, first: int, last: int) -> bool:
    """Whether a motion brakes before samples `first` to `last`, in which it is flat, and speeds up after them.

    A sensor that ends at its largest value leaves the motion at full speed. Short runs do not tell.
    """
    width = (last - first + 1) // 8
    before, after = first - 1, last + 1
    if width < 4 or before - 2 * width < 0 or after + 2 * width >= len(x):
        return False
    for edge, away in ((before, -width), (after, width)):
        near, far = abs(x[edge] - x[edge + away]), abs(x[edge + away] - x[edge + 2 * away])
        if not near <= MAX_BRAKED_SHARE * far:
            return False
    return True


def is_own_speed(position: np.ndarray, velocity: np.ndarray, time: np.ndarray, first: int, last: int) -> bool:
    """Whether the position moves at the flat value of a recorded velocity in samples `first` to `last`.

    A clipped velocity is too small for what the position does, a constant speed is not.
    """
    span = float(time[last] - time[first])
    if last <= first or span <= 0.0:
        return False
    moved = float(position[last] - position[first]) / span
    return abs(moved - velocity[first]) <= 0.1 * abs(velocity[first])


def is_only_noise(x: np.ndarray, width: int) -> bool:
    """Whether a signal, (n,), does nothing slower than noise: means over `width` samples differ as noise makes them."""
    x = x[np.isfinite(x)]
    count = len(x) // max(width, 1)
    if count < 3:
        return False
    means = x[: count * width].reshape(count, width).mean(axis=1)
    noise = float(np.std(np.diff(x))) / np.sqrt(2.0)
    return float(np.std(means)) <= 4.0 * noise / np.sqrt(width)
