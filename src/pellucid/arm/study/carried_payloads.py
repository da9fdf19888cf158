"""Drive gains of a robot by the study's choice, and payloads identified from recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...models.friction_terms import STRIBECK_FRICTION
from ...models.parameter import Parameter
from ...models.robot import Robot
from ...study.study import Study
from ..fit.drive_gains import gains_from_desired, gains_from_payload
from ..fit.payload import identify_payload
from ..fit.tree_estimate import TreeEstimate
from ..tree_motion import TreeMotion
from .tree_result import FoundPayload
from .tree_table import TreeTable

GAIN_SOURCES = {
    "stated": "as stated in study.toml",
    "desired": "from the controller's desired torque and current",
    "payload": "from recordings with and without a known payload",
}
"""Sources of the drive gains, in words."""


def with_gains(
    study: Study, robot: Robot, motions: Sequence[TreeMotion]
) -> tuple[list[TreeMotion], tuple[Parameter, ...]]:
    """Return the motions with efforts by the gains that `[tree] gains` requests, and these gains.

    There are no gains if they are stated. Only fitted recordings determine gains.
    """
    table = study.table(TreeTable)
    if table.gains == "desired":
        gains = gains_from_desired(robot, _empty(motions), width=table.velocity_width)
    elif table.gains == "payload":
        gains = _gains_from_payloads(robot, motions, _calibrating(study, motions), table.velocity_width)
    else:
        return list(motions), ()
    each = np.array([g.value for g in gains])
    known = (True,) * len(each)
    turns = robot.turns_array
    return [replace(m, gain=each, gain_known=known, effort=(each * m.drive) @ turns) for m in motions], gains


def identify_payloads(
    study: Study, robot: Robot, motions: Sequence[TreeMotion], best: TreeEstimate, gains: Sequence[Parameter]
) -> tuple[FoundPayload, ...]:
    """Identify the payload of each recording with one, together with the fitted recordings without one.

    If a recording's stated mass determined the gains, its payload is identified with gains from the other such
    recordings. If it is the only one, its mass is marked as no test of the gains.
    """
    made = []
    if not all(motions[0].gain_known):
        return ()  # without gains there is no effort in N m, and so no mass
    # Stribeck terms are left out: their velocities are searched only without load, and the terms are small beside one.
    families = tuple(tuple(term for term in family if term != STRIBECK_FRICTION.name) for family in best.families)
    calibrating = _calibrating(study, motions)
    for name in _with_payload(motions):
        loaded = [m for m in motions if m.recording == name]
        spec = loaded[0].payload
        tests, own_gains = "gains", gains
        if name in calibrating:
            others = [other for other in calibrating if other != name]
            tests = "gains of other payloads" if others else "nothing"
            if others:
                own_gains = _gains_from_payloads(robot, motions, others, best.velocity_width)
        found = identify_payload(
            robot, _empty(motions), loaded, families, width=best.velocity_width, link=spec.link,
            gains=own_gains or None,
        )  # fmt: skip
        made.append(FoundPayload(name, found.mass, spec.mass, tuple(map(float, found.centre)), found.link, tests))
    return tuple(made)


def _calibrating(study: Study, motions: Sequence[TreeMotion]) -> list[str]:
    """Return the recordings whose stated payloads determine the gains, if `[tree] gains` requests payloads."""
    if study.table(TreeTable).gains != "payload":
        return []
    return _with_payload([m for m in motions if m.use == "fit"])


def _gains_from_payloads(
    robot: Robot, motions: Sequence[TreeMotion], names: Sequence[str], width: float
) -> tuple[Parameter, ...]:
    """Estimate the gains from the stated payloads of the recordings `names`.

    `width` is that of the smooth sign of friction [rad/s; m/s].
    """
    loaded = [[m for m in motions if m.recording == name] for name in names]
    last = robot.tree.order[-1].child
    links = list(dict.fromkeys(each[0].payload.link or last for each in loaded))
    if len(links) > 1:
        raise IdentificationError(
            f'[tree] gains = "payload": found payloads on the links {" and ".join(links)}, expected those that are '
            'fitted on one link; mark the recordings of the others use = "validate"'
        )
    masses = [mass for each in loaded if (mass := each[0].payload.mass) is not None]
    if len(masses) < len(loaded):
        raise IdentificationError(
            '[tree] gains = "payload": found a payload without a mass, expected the mass of each that is fitted'
        )
    link = links[0] if links else None
    return gains_from_payload(robot, _empty(motions), loaded, masses, width=width, link=link)


def _with_payload(motions: Sequence[TreeMotion]) -> list[str]:
    """Return the names of the recordings with a payload, each once."""
    return list(dict.fromkeys(m.recording for m in motions if m.payload is not None))


def _empty(motions: Sequence[TreeMotion]) -> list[TreeMotion]:
    """Return the motions without a payload that may be fitted."""
    return [m for m in motions if m.payload is None and m.use == "fit"]
