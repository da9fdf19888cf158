r"""Identify a payload from recordings without it and with it, and drive gains (effort per ampere or volt).

**Payload.** The payload moves with the link that carries it, so its columns are those of this link. Robot and payload
are fitted together, with friction that may depend on the load. The robot's parameters are then eliminated (Schur
complement), and the payload is the consistent body with the smallest sum of squares. Parameters that the motion does
not determine are not reported. The mass is among them if only first moments affect the effort.

Intervals come from the block covariance of all parameters. The uncertainty of drive gains from elsewhere is added.

**Gains** are estimated from a known payload, or from a controller's reported torque.

**From a payload.** The motors' effort includes friction, and i is the drive's reported current or voltage:

.. math::
   i_j = \gamma_j\,(Y x + Y_l\varphi + m\,Y_m)_j + e_j,\qquad k_j = 1/\gamma_j

where the load's mass m is known and its other nine inertial parameters are not. The noise is in i. With i among the
regressors and residuals in N m, small gains would make small residuals, and gains would be biased low. The residuals
are therefore in ampere, each drive is weighted by its own residual, and gamma and the other parameters are solved
together by Gauss-Newton steps.

**From a controller.** Some controllers report the torque of their own rigid-body model and the current they demand. The
gain follows from a regression of the current on torque, v, sign(v) and 1; the last three represent friction, which the
torque lacks. No load is needed, but the gain is only as accurate as the controller's model.

Intervals are the jackknife's over segments.
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
from .consistent_inertias import solve_consistent_inertias
from .fit_tree import UNDETERMINED_REASON, estimate_uncertainty, student_ratio
from .friction_terms import plain_families, smooth_sign
from .tree_estimate import BaseParameters, find_base_parameters
from .tree_regression import (
    LinearisedModel,
    TreeModel,
    TreeRows,
    TreeSolution,
    collect_rows,
    compute_loads,
    determined_parameters,
    fit_rows,
    linearise_rows,
    plain_solution,
    sum_normal_equations,
)

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
            "a payload needs recordings with and without it; found "
            f"{len(empty)} without and {sum(map(len, loaded))} with: record the same motion with and without it"
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
        return ("the least-squares solution is not physically consistent; this is the nearest consistent one",)


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
    moved = np.zeros_like(pulls)
    moved[:, free] = plain_solution(gram[np.ix_(free, free)], pulls[:, free].T, ridge=0.0).T
    share = np.array([g.standard_error / g.value for g in gains])
    own = moved[:, place] * share[:, None]
    return own.T @ own


MAX_STEPS = 30
"""Largest number of Gauss-Newton steps."""

GAIN_CHANGE_TOLERANCE = 1e-9
"""Steps stop when no gain changes by this relative amount."""

WEIGHTED_STEPS = 6
"""Number of steps after which the weights of drives stay fixed."""

LOAD_ROUND_COUNT = 3
"""Number of relinearisations of load-dependent friction."""


def gains_from_desired(robot: Robot, motions: Sequence[TreeMotion], *, width: float = 0.0) -> tuple[Parameter, ...]:
    """Estimate the gain of each motor from the controller's `desired` effort and `desired_drive`.

    `width` is that of the smooth sign of friction [rad/s; m/s].
    """
    lacking = [x.recording for x in motions if x.desired is None or x.desired_drive is None]
    if lacking or not motions:
        where = lacking[0] if lacking else "no recording"
        raise IdentificationError(
            f"{where}: found no desired torque and desired current of every joint, expected both; name their channels, "
            "or record the same motion with a known payload and without"
        )
    turns = np.asarray(robot.turns)
    back = np.linalg.inv(turns)
    sums: list[list[np.ndarray]] = [[] for _ in robot.names]
    for motion in motions:
        desired, drive = motion.desired, motion.desired_drive
        # Motions that lack either were refused above.
        assert desired is not None
        assert drive is not None
        wanted, speed = desired @ back, motion.velocity @ turns.T
        for i in range(len(robot.names)):
            v = speed[:, i]
            z = np.column_stack([wanted[:, i], v, smooth_sign(v, width), np.ones_like(v), drive[:, i]])
            for s in range(int(motion.segment.max(initial=-1)) + 1):
                mine = z[motion.moving[:, i] & (motion.segment == s)]
                sums[i].append(mine.T @ mine)
    found = []
    for i, each in enumerate(sums):
        whole = np.sum(each, axis=0)
        if len(each) < 2 or not _partial_slope(whole) > 0.0:
            raise IdentificationError(
                f"motor of {robot.names[i]}: its desired current does not rise with its desired torque; check the "
                "signs of both channels, and that the joint moves"
            )
        left = 1.0 / np.array([_partial_slope(whole - part) for part in each])
        found.append(_gain_parameter(robot, motions[0], i, 1.0 / _partial_slope(whole), _jackknife_error(left)))
    return tuple(found)


def _partial_slope(gram: np.ndarray) -> float:
    """Return the regression coefficient of the last column on the first, with the others as covariates.

    Returns 0 if the normal equations `gram` do not determine it.
    """
    size = np.sqrt(np.maximum(np.diag(gram), 0.0))
    kept = np.flatnonzero(size[:-1] > 0.0)
    if not size[0] > 0.0:
        return 0.0
    unit = gram[np.ix_(kept, kept)] / np.outer(size[kept], size[kept])
    if np.linalg.cond(unit) > 1e12:
        return 0.0
    return float(np.linalg.solve(unit, gram[kept, -1] / size[kept])[0] / size[0])


def _jackknife_error(left: np.ndarray) -> float:
    """Return the jackknife's standard error from estimates `left`, (s,), each without one segment."""
    n = len(left)
    return float(np.sqrt((n - 1) / n * np.sum((left - left.mean()) ** 2)) * student_ratio(n - 1.0))


def _gain_parameter(robot: Robot, motion: TreeMotion, i: int, value: float, error: float) -> Parameter:
    """Return the gain of motor i as a parameter."""
    unit = robot.units[i][1]
    drive = motion.drive_units[i] if motion.drive_units else "A"
    shown = value > 1.959964 * error
    return Parameter(f"{robot.names[i]}.gain", f"{unit}/{drive}", float(value), error, identifiable=bool(shown))


@dataclass(frozen=True, eq=False)
class _DriveSums:
    """Sums Z'Z for each segment and motor, with Z = [columns of all parameters, known part, reported drive].

    The known part is subtracted from the columns.
    """

    gram: np.ndarray  # Z'Z, (S, m, p + 2, p + 2)
    count: np.ndarray  # number of rows, (S, m)

    def without(self, segment: int) -> _DriveSums:
        """Return the sums over all rows but those of a segment."""
        return _DriveSums(
            self.gram.sum(axis=0, keepdims=True) - self.gram[segment : segment + 1],
            self.count.sum(axis=0, keepdims=True) - self.count[segment : segment + 1],
        )

    def solved(self, gamma: np.ndarray, x: np.ndarray, fixed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve for inverse gains, (m,), and parameters, (p,), from the start `gamma` and `x`.

        Parameters in the mask `fixed`, (p,), stay.
        """
        gram, count = self.gram.sum(axis=0), self.count.sum(axis=0)
        m, p = len(gamma), len(x)
        free = np.flatnonzero(~fixed)
        weight = None
        for step in range(MAX_STEPS):
            model = np.append(x, -1.0)  # coefficients of the columns and of the known part
            made = gram[:, :-1, :-1] @ model  # (m, p + 1): Z'a
            power = made @ model  # a'a
            met = gram[:, :-1, -1]  # Z'i
            if step < WEIGHTED_STEPS:
                square = gram[:, -1, -1] - 2.0 * gamma * (met @ model) + gamma**2 * power
                weight = count / np.maximum(square, 1e-12 * gram[:, -1, -1])
            left = met - gamma[:, None] * made  # Z'r
            hessian, slope = np.zeros((p + m, p + m)), np.zeros(p + m)
            hessian[:p, :p] = np.tensordot(weight * gamma**2, gram[:, :p, :p], 1)
            hessian[:p, p:] = (weight * gamma)[None] * made[:, :p].T
            hessian[p:, :p] = hessian[:p, p:].T
            hessian[p:, p:] = np.diag(weight * power)
            slope[:p] = (weight * gamma) @ left[:, :p]
            slope[p:] = weight * (left @ model)
            kept = np.append(free, p + np.arange(m))
            inner = hessian[np.ix_(kept, kept)]
            seen = determined_parameters(inner)
            move = np.zeros(len(kept))
            move[seen] = plain_solution(inner[np.ix_(seen, seen)], slope[kept][seen], ridge=0.0)
            change = move[len(free) :]
            # No gain changes its sign, or by more than half, in a step.
            share = min(1.0, 0.5 / max(np.max(np.abs(change / gamma)), 1e-300))
            x[free] += share * move[: len(free)]
            gamma = gamma + share * change
            if share == 1.0 and step >= WEIGHTED_STEPS and np.max(np.abs(change / gamma)) < GAIN_CHANGE_TOLERANCE:
                break
        return gamma, x


def gains_from_payload(
    robot: Robot,
    empty: Sequence[TreeMotion],
    loaded: Sequence[Sequence[TreeMotion]],
    masses: Sequence[float],
    families: Sequence[Sequence[str]] | None = None,
    *,
    width: float = 0.0,
    link: str | None = None,
) -> tuple[Parameter, ...]:
    """Estimate the gain of each motor from recordings without load and with loads of known `masses` [kg].

    `families` are the friction terms of each joint, plain ones by default. `link` carries the loads; the last by
    default.
    """
    if len(masses) != len(loaded) or not all(mass > 0.0 for mass in masses):
        raise IdentificationError(
            f"found masses {list(masses)}, expected one above 0 kg for each of {len(loaded)} payloads"
        )
    carried = collect_loaded_rows(robot, empty, loaded, width=width, link=link)
    rows = carried.rows
    drive = np.concatenate([x.drive for x in (*empty, *(y for each in loaded for y in each))])
    plain = plain_families(len(robot.names), robot.shared)
    model = TreeModel(robot, rows.base, plain if families is None else tuple(map(tuple, families)))
    fixed = np.zeros(len(model.names), bool)
    known = [carried.numbers(k)[0] for k in range(carried.loads)]
    fixed[known] = True
    # Least squares with the recorded gains is the start; the known masses correct its scale.
    start, _ = fit_rows(model, rows)
    found = start.values[known]
    scale = float(np.median(np.asarray(masses) / np.where(found > 0.0, found, np.nan)))
    scale = scale if np.isfinite(scale) else 1.0
    gains = np.array(empty[0].gain if empty[0].gain is not None else np.ones(len(robot.names))) * scale
    x = start.values * np.where(_scales_with_effort(model), scale, 1.0)
    x[known] = masses
    gamma = 1.0 / gains
    for _ in range(LOAD_ROUND_COUNT if model.loads else 1):
        sums = _drive_sums(model, carried, x, drive)
        gamma, x = sums.solved(gamma, x.copy(), fixed)
    if not np.all(gamma > 0.0):
        i = int(np.argmin(gamma))
        raise IdentificationError(
            f"motor of {robot.names[i]}: the payload gives a negative gain; check the sign of its drive and the mass"
        )
    left = np.array([1.0 / sums.without(s).solved(gamma, x.copy(), fixed)[0] for s in range(len(sums.count))])
    return tuple(
        _gain_parameter(robot, empty[0], i, 1.0 / gamma[i], _jackknife_error(left[:, i])) for i in range(len(gamma))
    )


def _scales_with_effort(model: TreeModel) -> np.ndarray:
    """Return a mask of the parameters that scale with the efforts: all but load coefficients, (p,)."""
    scales = np.ones(len(model.names), bool)
    scales[list(model.loads.values())] = False
    return scales


def _drive_sums(model: TreeModel, carried: LoadedRows, x: np.ndarray, drive: np.ndarray) -> _DriveSums:
    """Compute the sums of the model linearised at `x`, (p,), in the motors' rows."""
    rows = carried.rows
    n, m = rows.velocity.shape
    p, turns = len(model.names), np.asarray(rows.robot.turns)
    load = compute_loads(rows, model, x) if model.loads else None
    at = linearise_rows(model, replace(rows, effort=np.zeros((n, m))), load, model.alpha(x) if model.loads else None)
    back = np.linalg.inv(turns).T  # matrix from efforts of joints to efforts of motors
    gram, count = np.zeros((rows.segments, m, p + 2, p + 2)), np.zeros((rows.segments, m))
    for i in range(m):
        joints = np.flatnonzero(np.abs(back[i]) > 1e-12)
        used = np.flatnonzero(rows.used[:, joints].all(axis=1))
        z = np.zeros((len(used), p + 2))
        for j in joints:
            lines = np.searchsorted(rows.lines[j], used)
            z[:, at.places[j]] += back[i, j] * at.columns[j][lines]
            z[:, p] += back[i, j] * at.targets[j][lines]
        z[:, p + 1] = drive[used, i]
        for s in range(rows.segments):
            mine = z[rows.segment[used] == s]
            gram[s, i], count[s, i] = mine.T @ mine, len(mine)
    return _DriveSums(gram, count)
