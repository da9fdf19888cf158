r"""Identify the ten inertial parameters of a payload from recordings without it and with it.

The payload moves with the link that carries it, so its columns are those of this link. Robot and payload are fitted
together, with friction that may depend on the load. The robot's parameters are then eliminated (Schur complement), and
the payload is the consistent body with the smallest sum of squares. Parameters that the motion does not determine are
not reported. The mass is among them if only first moments affect the effort.

Intervals come from the block covariance of all parameters. The uncertainty of drive gains from elsewhere is added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.estimates import Estimates, Parameter
from ...models.kinematic_tree import BODY_QUANTITIES
from ...models.robot import Robot
from ...numerics.regression import make_parameters
from ..tree_motion import TreeMotion
from .base_parameters import BaseParameters, find_base_parameters
from .consistent_inertias import solve_consistent_inertias
from .fit_tree import UNDETERMINED_REASON
from .friction_terms import plain_families
from .tree_regression import (
    LinearisedModel,
    TreeModel,
    TreeRows,
    TreeSolution,
    collect_rows,
    compute_loads,
    fit_rows,
    linearise_rows,
    sum_normal_equations,
)
from .tree_uncertainty import estimate_uncertainty

PAYLOAD_PREFIX = "payload"
"""Prefix of the names of a payload's parameters."""


@dataclass(frozen=True, eq=False)
class LoadedRows:
    """Regression rows of recordings without and with loads."""

    rows: TreeRows  # rows whose base parameters end in ten parameters of each load, in the frame of the carrying link
    link: int  # index of the link that carries the loads
    place: int  # index of the first load's first parameter
    loads: int  # number of different loads

    def numbers(self, load: int = 0) -> np.ndarray:
        """Return the indices of the ten parameters of a load, (10,)."""
        return self.place + len(BODY_QUANTITIES) * load + np.arange(len(BODY_QUANTITIES))


def collect_loaded_rows(
    robot: Robot,
    empty: Sequence[TreeMotion],
    loaded: Sequence[Sequence[TreeMotion]],
    *,
    width: float = 0.0,
    link: str | None = None,
) -> LoadedRows:
    """Collect the rows of `empty` recordings and of those with each of several loads.

    `link` carries the loads; the last link by default. `width` is that of the smooth sign of friction [rad/s; m/s].
    """
    children = [joint.child for joint in robot.tree.order]
    if link is not None and link not in children:
        raise IdentificationError(
            f"{robot.tree.source}: found no link {link!r} for the payload, expected one of {', '.join(children)}"
        )
    if not empty or not loaded or not all(loaded):
        raise IdentificationError(
            "a payload needs recordings with it and without; found "
            f"{len(empty)} without and {sum(map(len, loaded))} with: record the same motion both ways"
        )
    at = len(children) - 1 if link is None else children.index(link)
    motions = [*empty, *(x for each in loaded for x in each)]
    rows = collect_rows(robot, motions, width=width, base=find_base_parameters(robot))
    carried = np.zeros((*rows.rigid.shape[:2], len(BODY_QUANTITIES) * len(loaded)))
    first, columns = sum(map(len, empty)), slice(len(BODY_QUANTITIES) * at, len(BODY_QUANTITIES) * (at + 1))
    for k, each in enumerate(loaded):
        for x in each:
            y = robot.tree.core.regressor(x.position, x.velocity, x.acceleration)[:, :, columns]
            carried[first : first + len(x), :, len(BODY_QUANTITIES) * k : len(BODY_QUANTITIES) * (k + 1)] = y
            first += len(x)
    names = tuple(
        f"{PAYLOAD_PREFIX}{f'_{k + 1}' if len(loaded) > 1 else ''}.{n}"
        for k in range(len(loaded))
        for n in BODY_QUANTITIES
    )
    rigid = np.concatenate([rows.rigid, carried], axis=2)
    extended = replace(rows, base=_append_independent(rows.base, names), rigid=rigid)
    return LoadedRows(extended, at, len(rows.base.names), len(loaded))


def _append_independent(base: BaseParameters, names: tuple[str, ...]) -> BaseParameters:
    """Append parameters `names` that are independent to base parameters."""
    (r, p), more = base.combination.shape, len(names)
    combination = np.zeros((r + more, p + more))
    combination[:r, :p], combination[r:, p:] = base.combination, np.eye(more)
    chosen = np.append(base.chosen, p + np.arange(more))
    return BaseParameters((*base.names, *names), (*base.members, *names), chosen, combination)


MIN_COLUMN_REMAINDER = 1e-6
"""A payload parameter is estimable only if its column, after projection on the robot's columns, keeps at least this
share of its norm."""

BODY_UNITS = ("kg", *("kg*m",) * 3, *("kg*m^2",) * 6)
"""Units of the ten inertial parameters of a body."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PayloadEstimate(Estimates):
    """A payload in the frame of the link that carries it: mass, first moments, moments of inertia about its origin.

    Attributes
    ----------
    link : str
        Link that carries the payload.
    body : ndarray, shape (10,)
        Consistent inertial parameters. Those that the motion does not determine are as small as possible.
    consistent : bool
        Whether least squares alone was consistent.
    centre : tuple of float
        Centre of mass in the link's frame [m]; nan if the mass is not determined.
    """

    link: str
    body: np.ndarray = field(repr=False)
    consistent: bool

    @property
    def mass(self) -> Parameter:
        """Mass [kg]."""
        return self["mass"]

    @property
    def centre(self) -> tuple[float, float, float]:
        """Centre of mass in the link's frame [m]; nan if the mass or a first moment is not determined."""
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
    """Identify the payload that a robot carries in `loaded` and not in `empty`.

    Parameters
    ----------
    robot : Robot
        Robot without the payload.
    empty, loaded : sequence of TreeMotion
        Motions without and with the payload.
    families : sequence of sequence of str, optional
        Friction terms of each joint; plain ones by default.
    width : float
        Width of the smooth sign of friction; 0 for the true sign [rad/s; m/s].
    link : str, optional
        Link that carries the payload; the last by default.
    gains : sequence of Parameter, optional
        Identified drive gains, in the order of motors. They replace the motions' own, and their standard errors widen
        the payload's intervals.
    """
    if gains is not None:
        factors = np.array([g.value for g in gains])
        empty, loaded = ([with_drive_gains(x, robot, factors) for x in motions] for motions in (empty, loaded))
    carried = collect_loaded_rows(robot, empty, [loaded], width=width, link=link)
    plain = plain_families(len(robot.names), robot.shared)
    model = TreeModel(robot, carried.rows.base, plain if families is None else tuple(map(tuple, families)))
    start, at = fit_rows(model, carried.rows)
    covariance = estimate_uncertainty(at, start).covariance
    place = carried.numbers()
    body, free, told = _solve_body(model, carried, start)
    own = covariance[np.ix_(place, place)]
    if gains is not None:
        own = own + _gain_covariance(model, carried, start, at, gains)
    made = make_parameters(BODY_QUANTITIES, BODY_UNITS, body, own, idle=~told)
    refused = tuple(p if t else replace(p, refused=UNDETERMINED_REASON) for p, t in zip(made, told, strict=True))
    return PayloadEstimate(
        parameters=refused,
        covariance=own,
        title=f"{PAYLOAD_PREFIX} on {robot.tree.order[carried.link].child}",
        link=robot.tree.order[carried.link].child,
        body=body,
        consistent=free,
    )


def with_drive_gains(motion: TreeMotion, robot: Robot, gains: np.ndarray) -> TreeMotion:
    """Return the motion with its effort computed from other drive gains, (m,)."""
    effort = (gains * motion.drive) @ np.asarray(robot.turns)
    return replace(motion, effort=effort, gain=gains, gain_known=(True,) * len(gains))


def _solve_body(model: TreeModel, carried: LoadedRows, start: TreeSolution) -> tuple[np.ndarray, bool, np.ndarray]:
    """Return the payload's consistent parameters, (10,), whether least squares was consistent, and a mask of the
    determined parameters, (10,)."""
    rows, place = carried.rows, carried.numbers()
    load = compute_loads(rows, model, start.values) if model.loads else None
    whole = sum_normal_equations(linearise_rows(model, rows, load, model.alpha(start.values)), apart=False).total()
    weight = 1.0 / start.sd**2
    gram, moment = np.tensordot(weight, whole.gram[0], 1), weight @ whole.moment[0]
    # The robot's determined parameters are eliminated; those on a bound keep their values.
    rest = np.setdiff1d(np.flatnonzero(start.seen & ~start.held), place)
    moment = moment - gram[:, start.held] @ start.values[start.held]
    shares = np.linalg.solve(gram[np.ix_(rest, rest)], np.column_stack([gram[np.ix_(rest, place)], moment[rest]]))
    normal = gram[np.ix_(place, place)] - gram[np.ix_(place, rest)] @ shares[:, :-1]
    projected = moment[place] - gram[np.ix_(place, rest)] @ shares[:, -1]
    size = np.sqrt(np.diag(gram)[place])
    # Columns within the span of the robot's columns consist of rounding only, and are removed.
    own = np.sqrt(np.maximum(np.diag(normal), 0.0)) > MIN_COLUMN_REMAINDER * size
    normal, projected = normal * np.outer(own, own), projected * own
    fit = solve_consistent_inertias(0.5 * (normal + normal.T), projected, 1)
    return fit.values, fit.free, fit.told & own


def _gain_covariance(
    model: TreeModel, carried: LoadedRows, start: TreeSolution, at: LinearisedModel, gains: Sequence[Parameter]
) -> np.ndarray:
    """Return the covariance of the payload's parameters, (10, 10), that the gains' standard errors cause."""
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
