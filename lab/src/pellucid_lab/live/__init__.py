"""Virtual rigs for a live session: a robot and its wearer, simulated in real time by an engine."""

from .elbow import virtual_elbow
from .knee import virtual_knee

__all__ = ["virtual_elbow", "virtual_knee"]
