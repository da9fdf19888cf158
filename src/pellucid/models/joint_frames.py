r"""Frames of a robot's joints from what its maker prints: rows of Denavit and Hartenberg, or axes as screws.

A row has four numbers. With the coordinate q added to theta (of a slide: to d), the frame behind a joint is in the one
before it at [1]_ [2]_

.. math::
    R_z(\theta)\,T_z(d)\,T_x(a)\,R_x(\alpha) \quad\text{(classic)}, \qquad
    R_x(\alpha)\,T_x(a)\,R_z(\theta)\,T_z(d) \quad\text{(modified)}

A classic row turns about the z axis of the frame before it. That frame's place is therefore the joint's own, and what
the row does beyond the joint belongs to the body behind it. A screw is an axis in the base's frame while every
coordinate is 0: its direction, and a point through which it passes.

.. [1] J. Denavit, R. S. Hartenberg, "A kinematic notation for lower-pair mechanisms based on matrices", 1955.
.. [2] J. J. Craig, "Introduction to Robotics: Mechanics and Control", section 3.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kinematic_tree import IDENTITY_POSE, Pose, Vector, compose_poses, roll_pitch_yaw, rotation

Z_AXIS: Vector = (0.0, 0.0, 1.0)
"""Axis of every joint that a row of Denavit and Hartenberg describes."""


@dataclass(frozen=True)
class JointFrame:
    """Frame of a joint in that of the joint which carries it, and where the frame of its body is."""

    place: Vector  # [m]
    turned: Vector  # roll, pitch and yaw [rad]
    axis: Vector  # in the joint's frame, of length 1
    body: Pose = IDENTITY_POSE  # frame in which the body is stated, in the joint's frame


@dataclass(frozen=True)
class FrameRow:
    """A row of Denavit and Hartenberg: lengths `a` and `d` [m], angles `alpha` and `theta` [rad]."""

    a: float
    alpha: float
    d: float
    theta: float

    @property
    def along_z(self) -> Pose:
        """Return the row's turn about z and its way along z."""
        return rotation((0.0, 0.0, self.theta)), np.array([0.0, 0.0, self.d])

    @property
    def along_x(self) -> Pose:
        """Return the row's turn about x and its way along x."""
        return rotation((self.alpha, 0.0, 0.0)), np.array([self.a, 0.0, 0.0])


def frame_of_row(row: FrameRow, convention: str, before: JointFrame | None) -> JointFrame:
    """Return a joint's frame from its row; `before` is the frame of the joint that carries it, None for the base.

    The `convention` is ``"classic"`` or ``"modified"``. Bodies are stated in the frame behind the row.
    """
    at = before.body if before is not None else IDENTITY_POSE
    if convention == "classic":
        body = compose_poses(row.along_z, row.along_x)
    else:
        at, body = compose_poses(at, compose_poses(row.along_x, row.along_z)), IDENTITY_POSE
    return JointFrame(_vector(at[1]), roll_pitch_yaw(at[0]), Z_AXIS, body)


def frame_of_screw(axis: Vector, through: Vector, carrier: Vector | None) -> JointFrame:
    """Return a joint's frame from its axis in the base's frame and a point of it [m].

    `carrier` is that point of the joint which carries it, None for the base. All frames are parallel to the base's
    while every coordinate is 0, and begin at these points; bodies are stated in them.
    """
    begin = np.zeros(3) if carrier is None else np.asarray(carrier)
    return JointFrame(_vector(np.asarray(through) - begin), (0.0, 0.0, 0.0), axis)


def _vector(values: np.ndarray) -> Vector:
    x, y, z = values
    return float(x), float(y), float(z)
