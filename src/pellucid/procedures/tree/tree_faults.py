"""Are recordings of a robot fit to identify all its joints from? Faults of the files, then of the motion."""

from __future__ import annotations

from ..._errors import PellucidError
from ...recordings.fault import Fault
from ...recordings.study import Study
from .recorded_tree import recorded_tree


def tree_faults(study: Study) -> list[Fault]:
    """Faults of the robot's file and of every recording."""
    try:
        recorded_tree(study)
    except PellucidError as error:
        return [Fault("refuse", "robot", "study.toml", "", str(error), "a robot and its motions", str(error))]
    return []
