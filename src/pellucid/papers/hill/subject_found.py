"""Findings on one virtual subject of the reproduction."""

from __future__ import annotations

from dataclasses import dataclass

from .steps import IdentifiedLeg
from .torque import TorqueComparison
from .training import Training


@dataclass(frozen=True, eq=False)
class SubjectFound:
    """All three steps of one subject."""

    name: str
    leg: IdentifiedLeg
    torque: TorqueComparison
    training: Training
