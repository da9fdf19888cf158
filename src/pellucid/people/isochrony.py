"""Isochrony: how mean velocity and duration grow with the amplitude of movements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..units import COORDINATES_BY_UNIT, Coordinate
from .design_columns import DIRECTION_DOWN, DIRECTION_UP, MeasuredMovement
from .indices import MEAN_VELOCITY, MOVEMENT_DURATION
from .movement_indices import cell_means


@dataclass(frozen=True)
class Isochrony:
    """Straight lines of mean velocity and of duration over amplitude."""

    condition: str
    direction: str
    participants: tuple[str, ...]
    velocity_r2: tuple[float, ...]  # R^2 of each participant's own line through the means of each amplitude
    velocity_slope: float  # slope of the line through the means over participants [1/s]
    velocity_intercept: float  # intercept of that line [rad/s]
    group_r2: float  # R^2 of that line
    duration_r2: tuple[float, ...]  # R^2 of each participant's own line of duration
    duration_slope: float  # slope of the line of duration through the means over participants [s/rad]
    duration_intercept: float  # intercept of that line [s]
    points: tuple[tuple[float, float, float], ...]  # amplitude, mean velocity and duration, averaged over participants
    people: tuple[tuple[tuple[float, float, float], ...], ...]  # the same of each participant
    unit: str = "rad"  # unit of amplitudes, "rad" or "m"; with "m" every [rad] above is [m]


def isochrony(
    movements: Sequence[MeasuredMovement],
    participants: Sequence[str],
    conditions: Sequence[str],
    along: Coordinate = COORDINATES_BY_UNIT["rad"],
) -> tuple[Isochrony, ...]:
    """Return the isochrony of every condition and direction with at least three amplitudes.

    `movements` are those of `participants` under `conditions`, `along` an angle or a position.
    """

    def si(amplitudes: Sequence[float]) -> np.ndarray:
        return np.asarray(amplitudes) / along.factor

    velocity, duration = (cell_means(movements, index.of) for index in (MEAN_VELOCITY, MOVEMENT_DURATION))
    found = []
    for condition in conditions:
        for direction in (DIRECTION_UP, DIRECTION_DOWN):
            each = [_person_line(person, condition, direction, velocity, duration) for person in participants]
            each = [(person, *line) for person, line in zip(participants, each, strict=True) if line is not None]
            if not each:
                continue
            amplitudes = sorted(set.intersection(*(set(a) for _, a, *_ in each)))
            if len(amplitudes) < 3:
                continue
            v = [np.mean([vs[a] for _, _, vs, _ in each]) for a in amplitudes]
            t = [np.mean([ts[a] for _, _, _, ts in each]) for a in amplitudes]
            slope, intercept, r2 = affine(si(amplitudes), np.array(v))
            dslope, dintercept, _ = affine(si(amplitudes), np.array(t))
            found.append(
                Isochrony(
                    condition, direction, tuple(person for person, *_ in each),
                    tuple(affine(si(a), np.array([vs[x] for x in a]))[2] for _, a, vs, _ in each),
                    slope, intercept, r2,
                    tuple(affine(si(a), np.array([ts[x] for x in a]))[2] for _, a, _, ts in each),
                    dslope, dintercept,
                    tuple(zip(si(amplitudes).tolist(), map(float, v), map(float, t), strict=True)),
                    tuple(tuple((float(si(x)), vs[x], ts[x]) for x in a) for _, a, vs, ts in each),
                    along.unit,
                )
            )  # fmt: skip
    return tuple(found)


def _person_line(person, condition, direction, velocity: Mapping, duration: Mapping):
    """Return a person's amplitudes [deg or mm] with mean velocity and duration; None with fewer than three."""
    cells = [
        key[2] for key in velocity
        if key[:2] == (person, condition) and key[2][1] == direction and key[2][0] is not None
    ]  # fmt: skip
    if len(cells) < 3:
        return None
    cells = sorted(cells)
    v = {cell[0]: velocity[person, condition, cell] for cell in cells}
    t = {cell[0]: duration[person, condition, cell] for cell in cells}
    return [cell[0] for cell in cells], v, t


def affine(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float]:
    """Return slope, intercept and R² of the least-squares line through x and y, (n,); R² is NaN if y is constant."""
    slope, intercept = np.polyfit(x, y, 1)
    spread = float(np.sum((y - y.mean()) ** 2))
    rest = float(np.sum((y - slope * x - intercept) ** 2))
    return float(slope), float(intercept), 1.0 - rest / spread if spread > 0.0 else float("nan")
