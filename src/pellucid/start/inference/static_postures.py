"""Find recordings that hold postures: they weigh the joint by gravity alone, without friction's sign or inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .motion_efforts import running_mean

MIN_HOLD_S = 0.5
"""A posture counts if it is held for at least this long [s]."""

STILL_SPEED_SHARE = 0.02
"""A joint is still below this share of its largest speed."""

MIN_POSTURE_COUNT = 3
"""A recording holds postures if it rests at least in so many places."""

MIN_STILL_SHARE = 0.5
"""A recording holds postures if it is still for at least this share of its time."""

MIN_POSTURE_DISTANCE_SHARE = 0.05
"""Postures are different ones if they lie apart by at least this share of the range."""


@dataclass(frozen=True)
class HeldPostures:
    """Postures that a recording holds."""

    positions: tuple[float, ...]  # mean positions of the holds, in the column's unit
    still_share: float  # share of the time in which the joint is still

    @property
    def is_static(self) -> bool:
        """Whether the recording is one of postures."""
        return len(self.positions) >= MIN_POSTURE_COUNT and self.still_share >= MIN_STILL_SHARE


def find_postures(position: np.ndarray, rate: float) -> HeldPostures:
    """Return the different postures that positions, shape (n,), sampled at `rate` [Hz], hold."""
    smooth = running_mean(position, max(1, round(0.05 * rate)))
    speed = np.abs(np.gradient(smooth)) * rate
    still = speed < STILL_SPEED_SHARE * max(float(np.quantile(speed, 0.995)), 1e-12)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], still, [False])).astype(int)))
    spans = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= MIN_HOLD_S * rate]
    apart, distinct = MIN_POSTURE_DISTANCE_SHARE * float(np.ptp(smooth)), list[float]()
    for a, b in spans:
        place = float(np.mean(smooth[a:b]))
        if all(abs(place - other) > apart for other in distinct):
            distinct.append(place)
    return HeldPostures(tuple(distinct), float(np.mean(still)))
