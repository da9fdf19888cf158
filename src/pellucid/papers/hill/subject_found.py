"""Findings on one virtual subject of the reproduction."""

from __future__ import annotations

from dataclasses import dataclass

from .steps import LegFound
from .torque import TorqueFound
from .training import Training


@dataclass(frozen=True, eq=False)
class SubjectFound:
    """All three steps of one subject."""

    name: str
    leg: LegFound
    torque: TorqueFound
    training: Training
