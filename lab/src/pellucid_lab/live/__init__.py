"""Virtual rigs for a live session: a robot and somebody who wears it, as an engine moves them in real time."""

from .elbow import virtual_elbow
from .knee import virtual_knee

__all__ = ["virtual_elbow", "virtual_knee"]
