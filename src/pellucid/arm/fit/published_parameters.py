"""Parameters of a robot's model from published friction and its stated bodies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...models.kinematic_tree import BODY_QUANTITIES
from .tree_regression import TreeModel


def published_parameters(model: TreeModel, published: Mapping[str, Mapping[str, float]]) -> np.ndarray | None:
    """Return the model's parameters, (p,), from `published` values by joint and name, and the stated links.

    Returns None if dry or viscous friction of any joint is missing.
    """
    base, robot = model.base, model.robot
    said = {f"{joint}.{name}": value for joint, table in published.items() for name, value in table.items()}
    if any(f"{joint}.{name}" not in said for joint in robot.names for name in ("coulomb", "viscous")):
        return None
    bodies = len(BODY_QUANTITIES) * len(robot.tree.order)
    numbers = [*robot.tree.parameters, *(said.get(name, 0.0) for name in base.members[bodies:])]
    return np.concatenate([base.combination @ numbers, [said.get(n, 0.0) for n in model.names[len(base.names) :]]])
