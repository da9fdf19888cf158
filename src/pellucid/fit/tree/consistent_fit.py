r"""A robot whose links are bodies that can exist, and whose joints only lose power.

The model of `tree_regression`, in the ten numbers of every link instead of base parameters: normal equations of base
parameters become those of all numbers by \(M\), \(N \to M^T N M\), so that nothing is summed again. Joints weigh as in the
fit without bounds. What the efforts do not show comes from `nearest`, and each parameter says so.

Bounds bend a fit, so that no covariance of least squares holds: intervals are the jackknife's over segments [1]_, each
left out in turn and the rest fitted again within the same bounds.

.. [1] B. Efron, C. Stein, "The jackknife estimate of variance", Ann. Statist. 9, 1981.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.kinematic_tree import BODY
from ...models.pseudo_inertia import LENGTH
from ..parameter import Parameter
from ..uncertainty import student_over_normal
from .base_parameters import rigid_names
from .consistent_inertias import SEEN, ConsistentFit, consistent_inertias
from .fit_tree import UNSEEN
from .tree_estimate import Ripple, TreeEstimate
from .tree_regression import NUMBERS, NormalEquations, TreeModel, TreeRows, TreeSolution, linearised, loads_of, normal_equations

FROM_MAKER = "the motion does not show it: from the maker's numbers"
STEPS = 6  # of Gauss and Newton, at most; without load terms the first is the last
SETTLED = 1e-4  # of the RMS effort
TOLD = 1e-6  # of a parameter's direction that no effort shows, from which on it is not told


@dataclass(frozen=True, eq=False)
class ConsistentModel:
    """All numbers of a robot behind a model's base parameters: `names` and `units` (c,), `spread` (p, c) with base
    parameters and friction = spread @ numbers, bounds (c,)."""

    model: TreeModel
    names: tuple[str, ...]
    units: tuple[str, ...]
    spread: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray
    links: int

    @classmethod
    def of(cls, model: TreeModel) -> ConsistentModel:
        """Of a model of base parameters."""
        members, r = model.base.members, len(model.base.names)
        p, extra = len(members), len(model.names) - r
        links = len(model.robot.tree.order)
        spread = np.zeros((r + extra, p + extra))
        spread[:r, :p], spread[r:, p:] = model.base.combination, np.eye(extra)
        lowest, highest = (np.concatenate([np.full(p, end), b[r:]]) for end, b in zip((-np.inf, np.inf), model.bounds, strict=True))
        lowest[links * len(BODY) : p] = 0.0
        kinds = {"mas": "kg", "mom": "kg*m"}
        slides = dict(zip(model.robot.names, model.robot.prismatic, strict=True))
        units = [kinds.get(name.rpartition(".")[2][:3], "kg*m^2") for name in members[: links * len(BODY)]]
        units += ["kg" if slides[name.rpartition(".")[0]] else "kg*m^2" for name in members[links * len(BODY) :]]
        return cls(model, (*members, *model.names[r:]), (*units, *model.units[r:]), spread, lowest, highest, links)
