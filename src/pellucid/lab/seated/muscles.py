"""A virtual knee's muscles: elastic tendons, and paths that are tables of the knee's angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ... import _core
from ...models.hill import HillMuscle
from ...models.muscle_geometry import muscle_table

KNEE = (-2.20, 0.17)
"""Angles that the tables cover [rad]."""

POINTS = 475  # of the tables: 5 mrad apart
DRIVES = np.concatenate([[0.0], np.geomspace(2e-3, 1.0, 24)])  # activations of the maps
TORQUES = 160  # entries of a map's inverse


@dataclass(frozen=True)
class VirtualMuscle:
    """One muscle of a subject, as it is and not as the anatomical model has it."""

    constants: HillMuscle
    tendon_strain: float  # Under the largest force [1]
    share: float  # Of the drive of its group [1]
    size: float  # Of the path's lengths, beside the anatomical model [1]
    arm: float  # Of the moment arm, beside the anatomical model's of that size [1]

    @property
    def name(self) -> str:
        """As in the anatomical model."""
        return self.constants.name

    def path(self, knee: np.ndarray, hip: float, rest: float) -> tuple[np.ndarray, np.ndarray]:
        """Musculotendon length and moment arm at knee angles, each shape (n,) [m]; at `rest` the length is the
        anatomical model's of that size."""
        geometry = muscle_table().geometry[self.name]
        angles = {"knee": np.append(knee, rest), "hip": np.full(len(knee) + 1, hip)}
        length = geometry.length(angles)
        arm = self.size * self.arm * geometry.moment_arm("knee", angles)[:-1]
        return self.size * (length[-1] + self.arm * (length[:-1] - length[-1])), arm


def torque_at_rest(group: Sequence[VirtualMuscle], activation: float, hip: float, knee: float) -> float:
    """Torque of muscles that hold still at a knee angle [rad], each with its share of an activation [N m]."""
    torque = 0.0
    for muscle in group:
        length, arm = muscle.path(np.array([knee]), hip, knee)
        elastic = _core.ElasticMuscle(muscle.constants.vector(), tendon_strain=muscle.tendon_strain, period=0.002)
        torque += float(arm[0]) * elastic.rest(min(1.0, activation * muscle.share), float(length[0]))
    return torque


class Muscles:
    """Muscles of one knee, step by step. `hip`, `rest` [rad]; `knee` [rad]; `period` [s]."""

    def __init__(self, muscles: Sequence[VirtualMuscle], hip: float, rest: float, knee: float, period: float) -> None:
        grid = np.linspace(*KNEE, POINTS)
        paths = [m.path(grid, hip, rest) for m in muscles]
        self._length = np.array([p[0] for p in paths]).T.tolist()
        self._arm = np.array([p[1] for p in paths]).T.tolist()
        self._per_step = (POINTS - 1) / (KNEE[1] - KNEE[0])
        self.elastic = [
            _core.ElasticMuscle(m.constants.vector(), tendon_strain=m.tendon_strain, period=period) for m in muscles
        ]
        for muscle, length in zip(self.elastic, self._at(knee)[0], strict=True):
            muscle.rest(0.0, length)

    def _at(self, knee: float) -> tuple[list[float], list[float]]:
        place = min(max((knee - KNEE[0]) * self._per_step, 0.0), POINTS - 1.001)
        i = int(place)
        w = place - i
        length, arm = (
            [(1.0 - w) * a + w * b for a, b in zip(table[i], table[i + 1], strict=True)]
            for table in (self._length, self._arm)
        )
        return length, arm

    def step(self, activation: Sequence[float], knee: float) -> tuple[float, list[float]]:
        """One period on, to activations and a knee angle [rad]: torque [N m], and every muscle's force [N]."""
        length, arm = self._at(knee)
        force = [m.step(a, x) for m, a, x in zip(self.elastic, activation, length, strict=True)]
        return sum(r * f for r, f in zip(arm, force, strict=True)), force


class DriveMap:
    """Which drive of a group of muscles holds a torque at a knee angle: static optimisation done beforehand.

    With a fixed sharing among synergists, the least drive that gives a torque is the only one.

    `hip`, `rest` [rad].
    """

    def __init__(self, group: Sequence[VirtualMuscle], hip: float, rest: float) -> None:
        self._grid = np.linspace(-2.10, 0.0, 22)
        torque, self._passive = np.zeros((len(self._grid), len(DRIVES))), np.zeros(len(self._grid))
        for muscle in group:
            length, arm = muscle.path(self._grid, hip, rest)
            elastic = _core.ElasticMuscle(muscle.constants.vector(), tendon_strain=muscle.tendon_strain, period=0.002)
            for i, (x, r) in enumerate(zip(length, arm, strict=True)):
                force = [elastic.rest(min(1.0, a * muscle.share), float(x)) for a in DRIVES]
                torque[i] += abs(float(r)) * (np.array(force) - force[0])
                self._passive[i] += abs(float(r)) * force[0]
        torque = np.maximum.accumulate(torque, axis=1) + 1e-9 * np.arange(len(DRIVES))
        # Even steps of the root: little torques are what swings are made of.
        self._most = float(torque[:, -1].max())
        wanted = self._most * np.linspace(0.0, 1.0, TORQUES) ** 2
        self._drive = np.array([np.interp(wanted, row, DRIVES) for row in torque]).tolist()
        self._first = float(self._grid[0])
        self._per_angle = (len(self._grid) - 1) / float(self._grid[-1] - self._grid[0])

    def passive(self, knee: np.ndarray) -> np.ndarray:
        """Torque at no drive, in the group's own direction, shape (n,) [N m], at knee angles [rad]."""
        return np.interp(knee, self._grid, self._passive)

    def drive(self, torque: float, knee: float) -> float:
        """Drive [1] for a torque of the group's own direction [N m] at a knee angle [rad]."""
        if torque <= 0.0:
            return 0.0
        row = min(max((knee - self._first) * self._per_angle, 0.0), len(self._grid) - 1.001)
        column = min((torque / self._most) ** 0.5 * (TORQUES - 1), TORQUES - 1.001)
        i, j = int(row), int(column)
        w, v = row - i, column - j
        near, far = self._drive[i], self._drive[i + 1]
        return (1 - w) * ((1 - v) * near[j] + v * near[j + 1]) + w * ((1 - v) * far[j] + v * far[j + 1])
