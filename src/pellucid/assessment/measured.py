"""One movement of a participant under a condition, with its indices: what tables of indices are made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..signals.movements import Movement

UP, DOWN = "up", "down"
"""Along the angle, which is 0 where the segment hangs, and back."""


@dataclass(frozen=True)
class Measured:
    """One movement and its indices."""

    participant: str
    condition: str
    recording: str
    movement: Movement
    # Labelled amplitude [deg, of a place mm] (None where there is none, or too many) and direction: movements that are
    # alike
    cell: tuple[float | None, str]
    values: Mapping[str, float]  # By index, in SI; NaN where it could not be had


@dataclass(frozen=True)
class Lasted:
    """How long one movement was seen, and whether it had settled by then; those without an index too."""

    participant: str
    condition: str
    cell: tuple[float | None, str]  # As of `Measured`
    seconds: float  # Infinite where it never set out, or turned round: it gave no movement
    settled: bool
