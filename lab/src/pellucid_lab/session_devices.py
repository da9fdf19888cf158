"""Virtual devices of a live session, by the names that ``[session]`` has for them: entry points of another group.

A device is a function of the names of laws, of a participant's place in the study, and of a seed. It returns what the
engine is started with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pellucid.live.setup import EngineSetup

VIRTUAL_MAX_GAP_S = 0.05
"""A law on a virtual rig goes on after gaps of this length [s]; a robot's law has five periods.

An ordinary or shared computer stalls now and then: a guest of a busy host was seen to stall for 25 ms at any priority,
thirteen times in a session of three minutes, and the supervisor then stopped a wearer of whom nothing was wrong. The
virtual drive's own watchdog takes its power off after ten periods all the same, and nobody is strapped in."""


def bridge_stalls(setup: EngineSetup) -> EngineSetup:
    """Return a virtual rig's setup whose laws go on after the stalls of an ordinary computer."""
    made = []
    for condition in setup.conditions:
        law = condition.law
        if law is not None:
            condition = replace(condition, law=replace(law, law=law.law.changed(max_age=VIRTUAL_MAX_GAP_S)))
        made.append(condition)
    return replace(setup, conditions=tuple(made))


def virtual_elbow(*, conditions: Sequence[str], place: int, seed: int) -> EngineSetup:
    """Return the elbow exoskeleton on the simulated person at a `place` in the study, from 0."""
    from .live import virtual_elbow as make

    return bridge_stalls(make(conditions=conditions, person=place, seed=seed))


def virtual_knee(*, conditions: Sequence[str], place: int, seed: int) -> EngineSetup:
    """Return the knee orthosis on the virtual subject at a `place` in the study, from 0."""
    from .knee.rig import knee_orthosis
    from .live import virtual_knee as make

    subjects = list(knee_orthosis().subjects)
    return bridge_stalls(make(subject=subjects[place % len(subjects)], seed=seed + place))
