"""Findings on one virtual subject of the reproduction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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
    # Error on the held-out swing of each order of release over that of all parameters at once [1]
    released: Mapping[str, float] = field(default_factory=dict)
