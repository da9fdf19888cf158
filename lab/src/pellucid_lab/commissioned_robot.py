"""The virtual robot of a study that is commissioned: its joint, alone or on a wearer at ease. An entry point.

The joint is the rig's as one rigid body, with friction on bristles, which no model of the core has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pellucid.study.study_place import RIG_FILE

from .bench.rig import BenchRig
from .elbow.rig import ElbowRig
from .known_rigs import load_rig

SUBSTEPS = 8
"""Steps of the integration in a control period."""

BRISTLE_TRAVEL = 1e-3
"""Way over which friction builds up [rad or m]."""

DELAY_PERIODS = 1
"""Control periods by which the drive answers late."""

LIMB_INERTIA_SHARE = 1.0
"""Inertia of the wearer's limb over that of the robot [1]."""

STRAP_HZ = 8.0
"""Natural frequency of the limb on its strap."""

MOTION_HZ = 0.4
"""Frequency of the wearer's oscillation."""

MOTION_SIZE = 0.35
"""Amplitude of that motion [rad or m]."""


@dataclass(frozen=True)
class JointNumbers:
    """A joint as one rigid body, SI."""

    inertia: float
    gravity_sine: float
    gravity_cosine: float
    coulomb: float
    viscous: float
    rest: float  # position at the start
    resolution: float  # of the encoder


def virtual_robot(folder: Path) -> Callable[[bool, float], VirtualRobot] | None:
    """Return what makes the virtual robot of a study's folder, or None for a folder without one of one joint."""
    if not (folder / RIG_FILE).is_file():
        return None
    rig = load_rig(folder / RIG_FILE)
    if isinstance(rig, ElbowRig):
        slider = 0.5 * (rig.constants.slider.low + rig.constants.slider.high)
        sine, cosine = rig.gravity(slider)
        low, high = (float(rig.friction(np.array(v), np.array(0.0))) for v in (0.5, 1.5))
        viscous = max(high - low, 0.0)
        numbers = JointNumbers(rig.inertia(slider), sine, cosine, low - 0.5 * viscous, viscous, 1.0, rig.quantum)
    elif isinstance(rig, BenchRig):
        joint = rig.constants.joint
        numbers = JointNumbers(
            joint.inertia, joint.gravity_sine, joint.gravity_cosine,
            0.5 * (joint.coulomb_positive + joint.coulomb_negative),
            0.5 * (joint.viscous_positive + joint.viscous_negative), 0.0,
            2.0 * math.pi / rig.constants.encoder.counts_per_turn,
        )  # fmt: skip
    else:
        return None
    return lambda worn, period: VirtualRobot(numbers, worn=worn, period=period)


class VirtualRobot:
    """A joint in steps of a control period.

    Parameters
    ----------
    numbers : JointNumbers
        The joint.
    worn : bool
        Whether somebody wears it; otherwise it rests where it is put before each start.
    period : float
        Control period [s].
    """

    def __init__(self, numbers: JointNumbers, *, worn: bool, period: float) -> None:
        self._numbers, self._worn, self._period = numbers, worn, period
        self._ticks = 0
        self._position = self._limb = numbers.rest if worn else self._hanging()
        self._velocity = self._limb_velocity = self._bristle = 0.0
        self._running = 0
        self._efforts = [0.0] * (DELAY_PERIODS + 1)

    def _hanging(self) -> float:
        sine, cosine = self._numbers.gravity_sine, self._numbers.gravity_cosine
        return math.atan2(-cosine, sine) if sine else 0.0

    def read(self) -> tuple[float, Mapping[str, float]]:
        """Return the time [s], the readings of both encoders [rad or m] and of the drive [N m or N]."""
        quantum = self._numbers.resolution
        position = quantum * round(self._position / quantum)
        return self._period * self._ticks, {"position": position, "joint": position, "drive": self._efforts[0]}

    def write(self, effort: float, *, enable: bool) -> None:
        """Go on for a period under an effort [N m or N]."""
        self._efforts = [*self._efforts[1:], effort if enable else 0.0]
        self._running = self._running + 1 if enable else 0
        for _ in range(SUBSTEPS):
            self._advance(self._efforts[0], self._period / SUBSTEPS)
        self._ticks += 1

    def _advance(self, effort: float, dt: float) -> None:
        n = self._numbers
        level = max(n.coulomb, 1e-6)
        stiffness = level / BRISTLE_TRAVEL
        bending = self._velocity - stiffness * abs(self._velocity) / level * self._bristle
        self._bristle += dt * bending
        damping = math.sqrt(stiffness * n.inertia)
        resist = stiffness * self._bristle + damping * bending + n.viscous * self._velocity
        weight = n.gravity_sine * math.sin(self._position) + n.gravity_cosine * math.cos(self._position)
        pull = 0.0
        if self._worn:
            limb = LIMB_INERTIA_SHARE * n.inertia
            strap = limb * (2.0 * math.pi * STRAP_HZ) ** 2
            pull = strap * (self._limb - self._position) + 0.1 * math.sqrt(strap * limb) * (
                self._limb_velocity - self._velocity
            )
            # From a second of the law in force on the wearer goes to and fro; before, the arm rests.
            late = max(self._running * self._period - 1.5, 0.0)
            wanted = n.rest + MOTION_SIZE * math.sin(2.0 * math.pi * MOTION_HZ * late)
            hold = limb * (2.0 * math.pi * 3.0) ** 2
            carried = weight if self._running * self._period < 1.0 else 0.0
            muscle = hold * (wanted - self._limb) - 1.4 * math.sqrt(hold * limb) * self._limb_velocity + carried
            self._limb_velocity += dt * (muscle - pull) / limb
            self._limb += dt * self._limb_velocity
        self._velocity += dt * (effort + pull - weight - resist) / n.inertia
        self._position += dt * self._velocity
