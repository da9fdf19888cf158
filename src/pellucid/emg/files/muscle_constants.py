"""The constants of each muscle that come from a model's file and not from a recording."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ... import _given
from ..._errors import RecordingError

PLAUSIBLE_RANGES: Mapping[str, tuple[float, float]] = {
    "largest_force": (1e-3, 1e5), "optimal_fibre_length": (1e-4, 2.0), "tendon_slack_length": (0.0, 2.0),
    "pennation": (0.0, 1.5),
}  # fmt: skip
"""Smallest and largest accepted value of each constant, in the units of `MuscleConstants`. They admit muscles from a
rat to an elephant."""


@dataclass(frozen=True)
class MuscleConstants:
    """One muscle of a musculoskeletal model."""

    name: str  # name in the file
    largest_force: float  # largest isometric force, at the optimal fibre length [N]
    optimal_fibre_length: float  # fibre length with the largest force [m]
    tendon_slack_length: float  # length at which the tendon begins to pull [m]
    pennation: float  # angle of the fibres to the tendon at the optimal fibre length [rad]


Muscle = TypeVar("Muscle", bound=MuscleConstants)


def require_physical(path: Path, muscle: Muscle) -> Muscle:
    """Return the muscle; raise a RecordingError if its name or a constant is not plausible."""
    if re.fullmatch(_given.NAME_PATTERN, muscle.name) is None:
        raise RecordingError(
            f"{path.name}: found the muscle {_given.visible_text(muscle.name[:100])!r}, expected letters, digits, "
            "blanks and . - _"
        )
    for what, bounds in PLAUSIBLE_RANGES.items():
        require_range(path, muscle.name, what, getattr(muscle, what), bounds=bounds)
    return muscle


def require_range(path: Path, muscle: str, what: str, found: float, *, bounds: tuple[float, float]) -> None:
    """Raise a RecordingError if the number `what` of a muscle lies outside its `bounds`."""
    low, high = bounds
    if not low <= found <= high:
        raise RecordingError(f"{path.name}, muscle {muscle}, {what}: found {found:g}, expected {low:g} to {high:g}")
