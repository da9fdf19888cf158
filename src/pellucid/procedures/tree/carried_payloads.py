"""Gains of a robot's drives as a study asks for them, and what the robot carried in recordings with a payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...fit.parameter import Parameter
from ...fit.tree.drive_gains import gains_from_desired, gains_from_payload
from ...fit.tree.payload import identify_payload
from ...fit.tree.tree_estimate import TreeEstimate
from ...models.robot import Robot
from ...recordings.study import Study
from ...signals.tree_motion import TreeMotion
from .tree_result import FoundPayload

GAINS = {
    "stated": "as stated in study.toml",
    "desired": "from the controller's desired torque and current",
    "payload": "from recordings with and without a known payload",
}
"""Where gains come from, in words."""


def with_gains(
    study: Study, robot: Robot, motions: Sequence[TreeMotion]
) -> tuple[list[TreeMotion], tuple[Parameter, ...]]:
    """The motions with efforts by the gains that `[tree] gains` asks for, and these gains; none where they are
    stated."""
    table = study.config.tree
    empty = [m for m in motions if m.payload is None and m.use == "fit"]
    if table.gains == "desired":
        gains = gains_from_desired(robot, empty, width=table.velocity_width)
    elif table.gains == "payload":
        names = dict.fromkeys(m.recording for m in motions if m.payload is not None)
        loaded = [[m for m in motions if m.recording == name] for name in names]
        masses = [each[0].payload.mass for each in loaded]
        link = loaded[0][0].payload.link if loaded else None
        gains = gains_from_payload(robot, _empty(motions), loaded, masses, width=table.velocity_width, link=link)
    else:
        return list(motions), ()
    each = np.array([g.value for g in gains])
    known = (True,) * len(each)
    turns = robot.turns_array
    return [replace(m, gain=each, gain_known=known, effort=(each * m.drive) @ turns) for m in motions], gains


def carried_payloads(
    robot: Robot, motions: Sequence[TreeMotion], best: TreeEstimate, gains: Sequence[Parameter]
) -> tuple[FoundPayload, ...]:
    """What hung on the robot in each recording with a payload, found with all recordings without one."""
    made = []
    if not all(motions[0].gain_known):
        return ()  # what is in ampere weighs nothing
    # Speeds of Stribeck terms are searched for a robot without load; beside a load that term is too little to matter.
    families = tuple(tuple(term for term in family if term != "stribeck") for family in best.families)
    for name in dict.fromkeys(m.recording for m in motions if m.payload is not None):
        loaded = [m for m in motions if m.recording == name]
        spec = loaded[0].payload
        found = identify_payload(
            robot, _empty(motions), loaded, families, width=best.velocity_width, link=spec.link,
            gains=gains or None,
        )  # fmt: skip
        made.append(FoundPayload(name, found.mass, spec.mass, tuple(map(float, found.centre)), found.link))
    return tuple(made)


def _empty(motions: Sequence[TreeMotion]) -> list[TreeMotion]:
    return [m for m in motions if m.payload is None]
