"""Muscles of a virtual knee: elastic tendons, and paths that are tabulated over the knee's angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellucid import _core
from pellucid.emg.models.hill import HillMuscle
from pellucid.emg.models.muscle_geometry import muscle_table

KNEE_RANGE_RAD = (-2.20, 0.17)
"""Smallest and largest knee angle of the tables [rad]."""

TABLE_POINT_COUNT = 475
"""Number of knee angles in a table, 5 mrad apart."""

MAP_DRIVES = np.concatenate([[0.0], np.geomspace(2e-3, 1.0, 24)])
"""Drives at which a map's torques are computed [1]."""

MAP_TORQUE_COUNT = 160
"""Number of torques at which a map's inverse is stored."""


@dataclass(frozen=True)
class VirtualMuscle:
    """One true muscle of a subject, which differs from the anatomical model."""

    constants: HillMuscle
    tendon_strain: float  # strain of the tendon under the largest isometric force [1]
    share: float  # activation of the muscle over the drive of its group [1]
    size: float  # lengths of the path over those of the anatomical model [1]
    arm: float  # moment arm over that of the anatomical model scaled by `size` [1]

    @property
    def name(self) -> str:
        """Return the muscle's name in the anatomical model."""
        return self.constants.name

    def path(self, knee: np.ndarray, hip: float, rest: float) -> tuple[np.ndarray, np.ndarray]:
        """Return musculotendon length and moment arm at angles of the knee, each shape (n,) [m].

        At the knee angle `rest` the length is that of the anatomical model scaled by `size`. All angles are in rad.
        """
        geometry = muscle_table().geometry[self.name]
        angles = {"knee": np.append(knee, rest), "hip": np.full(len(knee) + 1, hip)}
        length = geometry.length(angles)
        arm = self.size * self.arm * geometry.moment_arm("knee", angles)[:-1]
        return self.size * (length[-1] + self.arm * (length[:-1] - length[-1])), arm


def torque_at_rest(group: Sequence[VirtualMuscle], activation: float, hip: float, knee: float) -> float:
    """Return the static torque of a group of muscles at a knee angle [rad] under an activation [N m]."""
    torque = 0.0
    for muscle in group:
        length, arm = muscle.path(np.array([knee]), hip, knee)
        elastic = _core.ElasticMuscle(muscle.constants.vector(), tendon_strain=muscle.tendon_strain, period=0.002)
        torque += float(arm[0]) * elastic.rest(min(1.0, activation * muscle.share), float(length[0]))
    return torque


class Muscles:
    """The muscles of one knee, simulated step by step.

    Parameters
    ----------
    muscles : sequence of VirtualMuscle
    hip : float
        Angle of the hip, which does not move [rad].
    rest : float
        Knee angle at which the paths have the anatomical model's scaled lengths [rad].
    knee : float
        Knee angle at the start [rad].
    period : float
        Time of a step [s].
    """

    def __init__(self, muscles: Sequence[VirtualMuscle], hip: float, rest: float, knee: float, period: float) -> None:
        grid = np.linspace(*KNEE_RANGE_RAD, TABLE_POINT_COUNT)
        paths = [m.path(grid, hip, rest) for m in muscles]
        self._length = np.array([p[0] for p in paths]).T.tolist()
        self._arm = np.array([p[1] for p in paths]).T.tolist()
        self._per_step = (TABLE_POINT_COUNT - 1) / (KNEE_RANGE_RAD[1] - KNEE_RANGE_RAD[0])
        self.elastic = [
            _core.ElasticMuscle(m.constants.vector(), tendon_strain=m.tendon_strain, period=period) for m in muscles
        ]
        for muscle, length in zip(self.elastic, self._lengths_and_arms(knee)[0], strict=True):
            muscle.rest(0.0, length)

    def _lengths_and_arms(self, knee: float) -> tuple[list[float], list[float]]:
        """Interpolate every muscle's length and moment arm at a knee angle."""
        place = min(max((knee - KNEE_RANGE_RAD[0]) * self._per_step, 0.0), TABLE_POINT_COUNT - 1.001)
        i = int(place)
        w = place - i
        length, arm = (
            [(1.0 - w) * a + w * b for a, b in zip(table[i], table[i + 1], strict=True)]
            for table in (self._length, self._arm)
        )
        return length, arm

    def step(self, activation: Sequence[float], knee: float) -> tuple[float, list[float]]:
        """Advance by one period to activations and a knee angle [rad]; return torque [N m] and muscle forces [N]."""
        length, arm = self._lengths_and_arms(knee)
        force = [m.step(a, x) for m, a, x in zip(self.elastic, activation, length, strict=True)]
        return sum(r * f for r, f in zip(arm, force, strict=True)), force


class DriveMap:
    """A map from torque and knee angle to the drive of a group of muscles: static optimisation, computed beforehand.

    Synergists share the drive in fixed proportions. The drive that gives a torque is therefore unique, and no cost has
    to be minimised. `hip` and `rest` are as in `Muscles` [rad].
    """

    def __init__(self, group: Sequence[VirtualMuscle], hip: float, rest: float) -> None:
        self._grid = np.linspace(-2.10, 0.0, 22)
        torque, self._passive = np.zeros((len(self._grid), len(MAP_DRIVES))), np.zeros(len(self._grid))
        for muscle in group:
            length, arm = muscle.path(self._grid, hip, rest)
            elastic = _core.ElasticMuscle(muscle.constants.vector(), tendon_strain=muscle.tendon_strain, period=0.002)
            for i, (x, r) in enumerate(zip(length, arm, strict=True)):
                force = [elastic.rest(min(1.0, a * muscle.share), float(x)) for a in MAP_DRIVES]
                torque[i] += abs(float(r)) * (np.array(force) - force[0])
                self._passive[i] += abs(float(r)) * force[0]
        torque = np.maximum.accumulate(torque, axis=1) + 1e-9 * np.arange(len(MAP_DRIVES))
        # Steps are even in the root of the torque, because swings need small torques.
        self._max_torque = float(torque[:, -1].max())
        wanted = self._max_torque * np.linspace(0.0, 1.0, MAP_TORQUE_COUNT) ** 2
        self._drive = np.array([np.interp(wanted, row, MAP_DRIVES) for row in torque]).tolist()
        self._first = float(self._grid[0])
        self._per_angle = (len(self._grid) - 1) / float(self._grid[-1] - self._grid[0])

    def passive(self, knee: np.ndarray) -> np.ndarray:
        """Return the torque without drive at angles of the knee [rad], in the group's direction, shape (n,) [N m]."""
        return np.interp(knee, self._grid, self._passive)

    def drive(self, torque: float, knee: float) -> float:
        """Return the drive [1] for a torque in the group's direction [N m] at a knee angle [rad]."""
        if torque <= 0.0:
            return 0.0
        row = min(max((knee - self._first) * self._per_angle, 0.0), len(self._grid) - 1.001)
        column = min((torque / self._max_torque) ** 0.5 * (MAP_TORQUE_COUNT - 1), MAP_TORQUE_COUNT - 1.001)
        i, j = int(row), int(column)
        w, v = row - i, column - j
        near, far = self._drive[i], self._drive[i + 1]
        return (1 - w) * ((1 - v) * near[j] + v * near[j + 1]) + w * ((1 - v) * far[j] + v * far[j + 1])
