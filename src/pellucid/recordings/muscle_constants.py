"""What a model's file says of each muscle: the constants that are not recorded."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MuscleConstants:
    """One muscle of a musculoskeletal model."""

    name: str  # As the file has it
    largest_force: float  # Isometric, at the optimal length [N]
    optimal_fibre_length: float  # optimal_fibre_length, tendon_slack_length: [m]
    tendon_slack_length: float
    pennation: float  # Of the fibres at their optimal length [rad]
