"""What a model's file says of each muscle: the constants that are not recorded."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from .. import _given
from .._errors import RecordingError

RANGES: Mapping[str, tuple[float, float]] = {
    "largest_force": (1e-3, 1e5), "optimal_fibre_length": (1e-4, 2.0), "tendon_slack_length": (0.0, 2.0),
    "pennation": (0.0, 1.5),
}  # fmt: skip
"""What a muscle may be, of a rat's to an elephant's, in the units of `MuscleConstants`."""


@dataclass(frozen=True)
class MuscleConstants:
    """One muscle of a musculoskeletal model."""

    name: str  # As the file has it
    largest_force: float  # Isometric, at the optimal length [N]
    optimal_fibre_length: float  # optimal_fibre_length, tendon_slack_length: [m]
    tendon_slack_length: float
    pennation: float  # Of the fibres at their optimal length [rad]


Muscle = TypeVar("Muscle", bound=MuscleConstants)


def require_physical(path: Path, muscle: Muscle) -> Muscle:
    """The same muscle, if there may be such a one."""
    if re.fullmatch(_given.NAME, muscle.name) is None:
        raise RecordingError(
            f"{path.name}: found the muscle {_given.seen(muscle.name[:100])!r}, expected letters, digits, blanks and "
            ". - _"
        )
    for what, (low, high) in RANGES.items():
        require_range(path, muscle.name, what, getattr(muscle, what), low, high)
    return muscle


def require_range(path: Path, muscle: str, what: str, found: float, low: float, high: float) -> None:
    """RecordingError if a number of a muscle is none that it may have."""
    if not low <= found <= high:
        raise RecordingError(f"{path.name}, muscle {muscle}, {what}: found {found:g}, expected {low:g} to {high:g}")
