"""Virtual devices of a live session, by the names that ``[session]`` has for them: entry points of another group.

A device is a function of the names of laws, of a participant's place in the study, and of a seed. It returns what the
engine is started with.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..live.setup import EngineSetup


def virtual_elbow(*, conditions: Sequence[str], place: int, seed: int) -> EngineSetup:
    """Return the elbow exoskeleton on the virtual person at a `place` in the study, from 0."""
    from .live import virtual_elbow as make

    return make(conditions=conditions, person=place, seed=seed)


def virtual_knee(*, conditions: Sequence[str], place: int, seed: int) -> EngineSetup:
    """Return the knee orthosis on the virtual subject at a `place` in the study, from 0."""
    from .knee.rig import knee_orthosis
    from .live import virtual_knee as make

    subjects = list(knee_orthosis().subjects)
    return make(subject=subjects[place % len(subjects)], seed=seed + place)
