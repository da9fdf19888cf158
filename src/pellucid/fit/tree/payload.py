r"""What a robot carries: ten numbers of a load from recordings without it and with it.

The load turns with the link that carries it, so that its columns are those of this link, where it is carried. Robot and
load are fitted together, with friction that may take the load's share too; then, with what the robot leaves free taken
out of the sums (Schur's complement), the load is the body that can exist with the least sum of squares. A number that
the motion does not tell from the others is not reported, a mass of which only first moments show among them.

Intervals are those of all parameters in blocks; gains of drives that were found elsewhere add their own share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion
from ..estimates import Estimates
from ..parameter import Parameter
from ..regression import make_parameters
from .carried_load import PAYLOAD, LoadedRows, loaded_rows
from .consistent_inertias import consistent_inertias
from .fit_tree import UNSEEN
from .friction_terms import plain_families
from .tree_regression import Linearised, TreeModel, TreeSolution, fit_rows, linearised, loads_of, normal_equations
from .tree_uncertainty import tree_uncertainty

FAINT = 1e-6
"""Of a number's column, what the robot's own must leave of it."""

UNITS = ("kg", *("kg*m",) * 3, *("kg*m^2",) * 6)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PayloadEstimate(Estimates):
    """A load in the frame of the link that carries it: mass, first moments, moments of inertia about its origin.

    Attributes
    ----------
    link : str
        That carries it.
    body : ndarray, shape (10,)
        A body that can exist; numbers that are not told are the smallest such.
    consistent : bool
        Whether least squares was such a body already.
    centre : tuple of float
        Of mass, in the link's frame [m]; nan where the mass is not told.
    """

    link: str
    body: np.ndarray = field(repr=False)
    consistent: bool

    @property
    def mass(self) -> Parameter:
        """[kg]."""
        return self["mass"]

    @property
    def centre(self) -> tuple[float, float, float]:
        """Of mass, in the link's frame [m]; nan where mass or moment is not told."""
        told = not any(p.refused for p in self.parameters[:4])
        return tuple(self.body[1:4] / self.body[0]) if told else (float("nan"),) * 3

    def _facts(self) -> tuple[str, ...]:
        if self.consistent:
            return ()
        return ("least squares alone is no body that can exist; this is the nearest that is",)


def identify_payload(
    robot: Robot,
    empty: Sequence[TreeMotion],
    loaded: Sequence[TreeMotion],
    families: Sequence[Sequence[str]] | None = None,
    *,
    width: float = 0.0,
    link: str | None = None,
    gains: Sequence[Parameter] | None = None,
) -> PayloadEstimate:
    """The load that a robot carries in `loaded` and not in `empty`.

    Parameters
    ----------
    robot : Robot
    empty, loaded : sequence of TreeMotion
    families : sequence of sequence of str, optional
        Friction terms of each joint; left out, plain ones.
    width : float
        Of the smooth sign of friction; 0: the true sign [rad/s; m/s].
    link : str, optional
        Which carries it; left out, the last.
    gains : sequence of Parameter, optional
        Of drives, in the order of motors, where they were identified too: they take the place of the motions' own, and
        their standard errors widen the load's.
    """
    if gains is not None:
        factors = np.array([g.value for g in gains])
        empty, loaded = ([with_gains(x, robot, factors) for x in motions] for motions in (empty, loaded))
    carried = loaded_rows(robot, empty, [loaded], width=width, link=link)
    plain = plain_families(len(robot.names), robot.shared)
    model = TreeModel(robot, carried.rows.base, plain if families is None else tuple(map(tuple, families)))
    start, at = fit_rows(model, carried.rows)
    covariance = tree_uncertainty(at, start).covariance
    place = carried.numbers()
    body, free, told = _body(model, carried, start)
    own = covariance[np.ix_(place, place)]
    if gains is not None:
        own = own + _of_gains(model, carried, start, at, gains)
    made = make_parameters(BODY_QUANTITIES, UNITS, body, own, idle=~told)
    refused = tuple(p if t else replace(p, refused=UNSEEN) for p, t in zip(made, told, strict=True))
    return PayloadEstimate(
        parameters=refused,
        covariance=own,
        title=f"{PAYLOAD} on {robot.tree.order[carried.link].child}",
        link=robot.tree.order[carried.link].child,
        body=body,
        consistent=free,
    )


def with_gains(motion: TreeMotion, robot: Robot, gains: np.ndarray) -> TreeMotion:
    """The same, its effort by other gains of its drives, (m,)."""
    effort = (gains * motion.drive) @ np.asarray(robot.turns)
    return replace(motion, effort=effort, gain=gains, gain_known=(True,) * len(gains))


def _body(model: TreeModel, carried: LoadedRows, start: TreeSolution) -> tuple[np.ndarray, bool, np.ndarray]:
    """The load as a body, (10,); whether least squares was one; which of its numbers efforts tell, (10,)."""
    rows, place = carried.rows, carried.numbers()
    load = loads_of(rows, model, start.values) if model.loads else None
    whole = normal_equations(linearised(model, rows, load, model.alpha(start.values)), apart=False).total()
    weight = 1.0 / start.sd**2
    gram, moment = np.tensordot(weight, whole.gram[0], 1), weight @ whole.moment[0]
    # The robot's own: those that rows tell and no bound holds, which stay where they are.
    rest = np.setdiff1d(np.flatnonzero(start.seen & ~start.held), place)
    moment = moment - gram[:, start.held] @ start.values[start.held]
    shares = np.linalg.solve(gram[np.ix_(rest, rest)], np.column_stack([gram[np.ix_(rest, place)], moment[rest]]))
    normal = gram[np.ix_(place, place)] - gram[np.ix_(place, rest)] @ shares[:, :-1]
    projected = moment[place] - gram[np.ix_(place, rest)] @ shares[:, -1]
    size = np.sqrt(np.diag(gram)[place])
    # What rounding left of a column that the robot's own make too is no column.
    own = np.sqrt(np.maximum(np.diag(normal), 0.0)) > FAINT * size
    normal, projected = normal * np.outer(own, own), projected * own
    fit = consistent_inertias(0.5 * (normal + normal.T), projected, 1)
    return fit.values, fit.free, fit.told & own


def _of_gains(
    model: TreeModel, carried: LoadedRows, start: TreeSolution, at: Linearised, gains: Sequence[Parameter]
) -> np.ndarray:
    """Covariance of the load's numbers, (10, 10), that the gains' standard errors make."""
    rows, place = carried.rows, carried.numbers()
    turns = np.asarray(rows.robot.turns)
    of_motors = rows.effort @ np.linalg.inv(turns)
    free = np.flatnonzero(start.seen & ~start.held)
    gram, pulls = np.zeros((len(model.names),) * 2), np.zeros((len(gains), len(model.names)))
    for j, (where, x, lines) in enumerate(zip(at.places, at.columns, rows.lines, strict=True)):
        own = x / start.sd[j] ** 2
        gram[np.ix_(where, where)] += own.T @ x
        for i in np.flatnonzero(turns[:, j]):
            pulls[i, where] += own.T @ (of_motors[lines, i] * turns[i, j])
    size = np.sqrt(np.diag(gram)[free])
    moved = np.zeros_like(pulls)
    unit = gram[np.ix_(free, free)] / np.outer(size, size)
    moved[:, free] = np.linalg.solve(unit, (pulls[:, free] / size).T).T / size
    share = np.array([g.standard_error / g.value for g in gains])
    own = moved[:, place] * share[:, None]
    return own.T @ own
