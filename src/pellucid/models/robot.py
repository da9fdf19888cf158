"""A robot of several joints: a tree, and how motors turn with its joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._errors import IdentificationError
from .kinematic_tree import Tree

MAX_TURNS_CONDITION = 1e6
"""Condition of `turns` from which on motors do not tell the joints' motion."""

MIN_MOVING_RANGE = {False: 2e-3, True: 2e-4}
"""A joint counts as moving only if its range exceeds this: key False for rotary [rad], True for prismatic [m]."""


@dataclass(frozen=True)
class Robot:
    """A tree whose joints motors drive. Power is the same on both sides: motors turn at `turns` @ v, and what they give
    reaches the joints through its transpose."""

    tree: Tree
    # (m, m): turn of motor i by joint k, gears taken out, so that its diagonal is 1; () for the unit matrix
    turns: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self):
        m = len(self.tree.moving)
        turns = np.asarray(self.turns, float) if len(self.turns) else np.eye(m)
        where = f"{self.tree.source}: turns of motors"
        if turns.shape != (m, m) or not np.isfinite(turns).all():
            raise IdentificationError(f"{where}: found shape {turns.shape}, expected {m} rows of {m} finite numbers")
        odd = np.flatnonzero(np.abs(np.diag(turns) - 1.0) > 1e-12)
        if odd.size:
            i = int(odd[0])
            raise IdentificationError(
                f"{where}: found {turns[i, i]:g} of the motor of {self.names[i]} by its own joint, expected 1: gears "
                "are taken out"
            )
        if not np.linalg.cond(turns) < MAX_TURNS_CONDITION:
            raise IdentificationError(
                f"{where}: found linearly dependent rows, expected each motor to add information about the joints"
            )
        object.__setattr__(self, "turns", tuple(tuple(float(x) for x in row) for row in turns))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints that move, in the order of coordinates."""
        return tuple(joint.name for joint in self.tree.moving)

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """For each joint that moves, whether it slides [m, N] or turns [rad, N m]."""
        return tuple(joint.kind == "prismatic" for joint in self.tree.moving)

    @property
    def units(self) -> tuple[tuple[str, str], ...]:
        """For each joint that moves, the units of its coordinate and of its effort."""
        return tuple(("m", "N") if slides else ("rad", "N*m") for slides in self.prismatic)

    @property
    def shared(self) -> tuple[int, ...]:
        """Motors that turn with several joints."""
        return tuple(i for i, row in enumerate(self.turns) if np.count_nonzero(row) > 1)

    @property
    def turns_array(self) -> np.ndarray:
        """The same as `turns`, shape (m, m)."""
        return np.array(self.turns)
