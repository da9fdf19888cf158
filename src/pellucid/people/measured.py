"""One movement of a participant under a condition, with its indices. Tables of indices are made from these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .movements import Movement

DIRECTION_UP = "up"
"""Direction of increasing angle, which is 0 where the segment hangs."""

DIRECTION_DOWN = "down"
"""Direction of decreasing angle."""


@dataclass(frozen=True)
class MeasuredMovement:
    """One movement and its indices."""

    participant: str
    condition: str
    recording: str
    movement: Movement
    # Cell of similar movements: labelled amplitude [deg, or mm for a position], None if there is none or too many, and
    # direction
    cell: tuple[float | None, str]
    values: Mapping[str, float]  # values by index, in SI; NaN if a value could not be computed


@dataclass(frozen=True)
class MovementDuration:
    """How long one movement was seen, and whether it had settled by then; includes movements without indices."""

    participant: str
    condition: str
    cell: tuple[float | None, str]  # cell as in `MeasuredMovement`
    seconds: float  # time seen; infinite if the person never set out or turned round
    settled: bool
