"""Design identification motions for a robot of several joints within the limits of its study."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..._errors import PellucidError, StudyError
from ...models.robot import Robot
from ...numerics.protocols.protocol import write_references
from ...numerics.protocols.step_by_step import StepByStep, step_by_step
from ...numerics.protocols.tree_limits import TreeLimits
from ...study.procedures.procedure import Progress, quiet
from ..fit.tree_estimate import find_base_parameters
from ..protocols.tree_fourier import Capsules, Excitation, Information, capsules_along_links, optimised_tree_fourier

if TYPE_CHECKING:
    from ...study.study import Study

OPTIMISED_MOTION = "optimised_fourier"
"""Name of the optimised motion in `pellucid protocol`, and in `protocol` of a recording in study.toml."""

STEPWISE_MOTION = "step_by_step"
"""Name of the motion that moves joints in isolation, in the same places."""

MOTION_NAMES = (OPTIMISED_MOTION, STEPWISE_MOTION)
"""Names of all motions of several joints."""

MAX_REST_SPEED_SHARE = 0.05
"""Below this share of its velocity limit a joint counts as at rest."""

DEFAULT_ACCELERATION_TIME_S = 0.5
"""Time in which a joint reaches its velocity limit if no acceleration limit is stated [s]."""

RESERVED_EFFORT_SHARE = 0.5
"""Share of the effort limit that is reserved for friction and for errors of the stated bodies."""


LIMIT_KEYS = ("position_min", "position_max", "velocity")
"""Limits of a joint that a motion needs."""


def tree_information(robot: Robot, limits: TreeLimits) -> Information:
    """Return the information of a motion on base parameters and each joint's plain friction.

    Rows at rest carry no information, and efforts are divided by the drive's limit.
    """
    m, links = len(robot.names), len(robot.tree.order)
    bodies, own = 10 * links, 4 * m
    # The core's columns are those of links, then rotor, speed, sign and 1 of each joint, then those of shared motors.
    chosen = [
        i if i < bodies else bodies + 4 * (i - bodies) if i < bodies + m else i + own - m
        for i in find_base_parameters(robot).chosen
    ]
    chosen += [bodies + 4 * k + j for k in range(m) for j in (1, 2, 3)]
    band = MAX_REST_SPEED_SHARE * limits.velocity
    size = np.ones(m) if limits.effort is None else np.where(np.isfinite(limits.effort), limits.effort, 1.0)
    turns = robot.turns_array[list(robot.shared)]

    def information(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        q, v, a = (np.ascontiguousarray(x, float) for x in (position, velocity, acceleration))
        normal, _, _ = robot.tree.core.normal_equations(
            q, v, a, np.zeros_like(q),
            # A smooth transition between rest and motion, because the search follows gradients.
            weight=np.square(np.tanh((v / band) ** 2) / size),
            own=np.stack([a, v, np.tanh(v / band), np.ones_like(v)], axis=2),
            shared=(a @ turns.T)[:, None, :] * turns.T if robot.shared else None,
        )  # fmt: skip
        return normal[np.ix_(chosen, chosen)]

    return information


def limits_of(
    study: Study, robot: Robot, *, acceleration: float | None = None, radius: float = 0.05, clearance: float = 0.02
) -> TreeLimits:
    """Return the limits of a robot from ``[rig.limits]`` of each joint.

    `acceleration` applies to every joint [rad/s^2; m/s^2]; by default a joint reaches its velocity limit in half a
    second. `radius` is that of links and `clearance` the distance between them [m]. A radius of 0 is for an arm that
    cannot collide with itself.
    """
    stated_limits = {joint.joint: joint.limits for joint in study.rig.joints}
    for name in robot.names:
        missing = [key for key in LIMIT_KEYS if getattr(stated_limits[name], key) is None]
        if missing:
            raise StudyError(
                f"study.toml: [[rig.joints]] {name}: limits: found no {', '.join(missing)}, expected what a motion "
                'must keep to, such as limits = { position_min = "-90 deg", position_max = "90 deg", '
                'velocity = "2 rad/s" }'
            )
    low, high, velocity = (np.array([getattr(stated_limits[name], key) for name in robot.names]) for key in LIMIT_KEYS)
    efforts = (stated_limits[name].effort for name in robot.names)
    effort = np.array([np.inf if stated is None else stated for stated in efforts])
    bodies = any(link.mass > 0.0 for link in robot.tree.links)
    bound = {}
    if bodies and np.isfinite(effort).any():
        core = robot.tree.core

        def needed(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
            return core.inverse_dynamics(*(np.ascontiguousarray(x, float) for x in (q, v, a)))

        bound = {"effort": (1.0 - RESERVED_EFFORT_SHARE) * effort, "effort_of": needed}
    shape = shape_of(robot, radius, clearance) if radius > 0.0 else None
    if shape is not None and shape.pairs:
        core_of = robot.tree.core
        bound["distance"] = lambda q: shape.distance(core_of.placements(np.ascontiguousarray(q, float)))
    change = velocity / DEFAULT_ACCELERATION_TIME_S if acceleration is None else np.full(len(velocity), acceleration)
    return TreeLimits(robot.names, low, high, velocity, change, clearance=clearance, **bound)


def shape_of(robot: Robot, radius: float, clearance: float = 0.0) -> Capsules:
    """Return capsules along the links from joint to joint; the last ones end at twice their centre of mass.

    `radius` and `clearance` are in [m].
    """
    order = robot.tree.order
    number = {joint.child: i for i, joint in enumerate(order)}
    bodies = {link.name: link for link in robot.tree.links}
    tips = np.array([
        2.0 * np.array(bodies[j.child].moment) / bodies[j.child].mass if bodies[j.child].mass > 0.0 else np.zeros(3)
        for j in order
    ])  # fmt: skip
    parents = [number.get(joint.parent, -1) for joint in order]
    return capsules_along_links(parents, np.array([joint.place for joint in order], float), tips, radius, clearance)


@dataclass(frozen=True, eq=False)
class TreeProtocol:
    """Motions written for a robot."""

    files: tuple[Path, ...]  # files that were written
    limits: TreeLimits
    duration: float  # duration of the motion [s]
    made: Excitation | StepByStep
    parameters: int  # number of parameters that the motion should identify

    @property
    def gain(self) -> float | None:
        """Mean ratio of interval widths between a random motion within the same limits and this one.

        The random motion is the median of those drawn. None for a motion that is not optimised.
        """
        if not isinstance(self.made, Excitation):
            return None
        return float(np.exp((np.median(self.made.drawn) - self.made.cost) / (2.0 * self.parameters)))


def tree_protocol(
    name: str,
    study: Study,
    folder: str | os.PathLike,
    *,
    rate: float,
    resolution: float | None = None,
    harmonics: int = 5,
    criterion: str = "D",
    periods: int = 4,
    realisations: int = 1,
    acceleration: float | None = None,
    radius: float = 0.05,
    clearance: float = 0.02,
    posture: Sequence[float] = (),
    seed: int = 1,
    on_progress: Progress = quiet,
) -> TreeProtocol:
    """Write a motion of all joints of a study's robot to a `folder`, as CSV of time and a reference for each joint.

    `rate` is in [Hz]. `resolution` is one over an optimised motion's period [Hz], 0.1 by default. `posture`, (m,), is
    the position about which joints are isolated [rad; m].
    """
    from .recorded_tree import robot_of

    if name not in MOTION_NAMES:
        raise PellucidError(f"unknown motion {name!r}; known: {', '.join(MOTION_NAMES)}")
    robot = robot_of(study)
    limits = limits_of(study, robot, acceleration=acceleration, radius=radius, clearance=clearance)
    units = [unit for unit, _ in robot.units]
    information = tree_information(robot, limits)
    parameters = len(find_base_parameters(robot).names) + 3 * len(robot.names)
    if name == STEPWISE_MOTION:
        steps = step_by_step(limits, rate, posture=posture or None)
        columns = _columns(robot, steps.position, units)
        file = write_references(Path(folder) / f"{STEPWISE_MOTION}.csv", rate, columns)
        return TreeProtocol((file,), limits, steps.duration, steps, parameters)
    made, files = None, []
    for i in range(realisations):
        on_progress(f"optimising the motion of {len(robot.names)} joints", i / realisations)
        one = optimised_tree_fourier(
            information, limits, np.random.default_rng([seed, i]), fundamental=resolution or 0.1, harmonics=harmonics,
            criterion=criterion,
        )  # fmt: skip
        made = one if made is None or one.cost < made.cost else made
        time = np.arange(round(periods * one.series.period * rate) + 1) / rate
        columns = _columns(robot, one.series.motion(time)[0], units)
        files.append(write_references(Path(folder) / f"{OPTIMISED_MOTION}_{i + 1}.csv", rate, columns))
    if made is None:
        raise PellucidError(f"realisations: found {realisations}, expected at least 1")
    return TreeProtocol(tuple(files), limits, periods * made.series.period, made, parameters)


def _columns(robot: Robot, position: np.ndarray, units: Sequence[str]) -> Mapping[str, tuple[np.ndarray, str]]:
    return {name: (position[:, k], units[k]) for k, name in enumerate(robot.names)}
