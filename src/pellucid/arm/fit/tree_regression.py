r"""Weighted least squares for all joints of a robot together.

.. math::
   \tau_j = y_j + \alpha_j |y_j|\,s_j + \sum_t c_{jt}\,\varphi_t(v_j) + \sum_i T_{ij} f_i(c_i), \qquad y = Y_1\beta

with friction as in the core (`include/pellucid/friction.hpp`). Load friction is proportional to the load y of links,
rotors and motor inertias. The model is linear in all parameters but alpha. With alpha it is solved by Gauss-Newton
steps; the Jacobian has the rows of Y_1 times 1 + alpha s sign(y), and |y| s. The first step has alpha = 0 and the y of
a fit without load friction.

Normal equations are kept by segment and joint. Leaving a segment out is then a subtraction, and weighting joints is a
sum of a few small matrices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..._errors import IdentificationError
from ...models.friction_terms import COULOMB_FRICTION, LOAD_FEATURE, STRIBECK_FRICTION
from ...models.robot import Robot
from ...numerics.regression import least_squares_within
from ..tree_motion import TreeMotion
from .friction_terms import (
    FRICTION_COEFFICIENTS,
    MOTOR_PREFIX,
    ROTOR_INERTIA_UNITS,
    check_families,
    coefficient_names,
)
from .tree_estimate import BaseParameters, Ripple, find_base_parameters, rigid_columns


@dataclass(frozen=True)
class RegressionSettings:
    """Tolerances and limits of the weighted least squares."""

    # A parameter is determined only if this squared share of its unit column lies outside the span of the others.
    min_squared_remainder: float = 1e-9
    weight_round_count: int = 4  # number of times that the weights of joints are updated from their residuals
    max_active_sets: int = 60  # number of active sets that are tried before a general bounded search
    max_steps: int = 12  # largest number of Gauss-Newton steps
    # Gauss-Newton steps stop when loads and load friction change by at most this share of each joint's RMS effort.
    load_change_tolerance: float = 1e-4
    # Lower limit of a joint's residual standard deviation in its weight, as a share of its RMS effort.
    min_residual_share: float = 0.02


REGRESSION_SETTINGS = RegressionSettings()


class FrictionPart(NamedTuple):
    """A friction coefficient of a joint or of a motor."""

    joint: int  # index of the joint, or of the motor
    of_motor: bool  # whether it belongs to the motor
    number: str  # name of the coefficient in `FRICTION_COEFFICIENTS`
    speed: float = float("nan")  # Stribeck velocity of a Stribeck term [rad/s; m/s]


@dataclass(frozen=True, eq=False)
class TreeRows:
    """Rows of all recordings, stacked: N rows, m joints, r base parameters."""

    robot: Robot
    base: BaseParameters
    width: float  # width of the smooth sign of friction [rad/s; m/s]
    position: np.ndarray  # (N, m) [rad; m]
    velocity: np.ndarray  # (N, m) [rad/s; m/s]
    effort: np.ndarray  # (N, m) [N m; N]
    used: np.ndarray  # mask of the rows that count for each joint, (N, m)
    segment: np.ndarray  # segment number of each row over all recordings, (N,); -1 for none
    stretch: np.ndarray  # recording number of each row, (N,)
    rigid: np.ndarray  # regressor of the base parameters, (N, m, r)
    turned: np.ndarray  # angles of the motors, (N, m) [rad; m]
    turning: np.ndarray  # speeds of the motors, (N, m) [rad/s; m/s]
    motions: tuple[TreeMotion, ...]  # their rows follow each other, N in all
    made: dict[tuple[FrictionPart, float], np.ndarray] = field(default_factory=dict)  # columns of friction so far
    reversals: dict[int, np.ndarray] = field(default_factory=dict)  # what friction may do where a joint turns, so far

    @property
    def segments(self) -> int:
        """Number of segments."""
        return int(self.segment.max(initial=-1)) + 1

    def only(self, segments: Sequence[int]) -> TreeRows:
        """Return the rows with only those of these segments counting."""
        return replace(self, used=self.used & np.isin(self.segment, segments)[:, None])

    def friction(self, part: FrictionPart) -> np.ndarray:
        """Return the column of a coefficient in all rows, (N,), filtered as the effort is, without the load."""
        key = part, self.width
        if key not in self.made:
            turn = (self.robot.turns_array if part.of_motor else np.eye(len(self.robot.names)))[part.joint]
            law = FRICTION_COEFFICIENTS[part.number]
            self.made[key] = np.concatenate([law.rows(x, turn, self.width, part.speed) for x in self.motions])
        return self.made[key]

    @cached_property
    def lines(self) -> tuple[np.ndarray, ...]:
        """Indices of the rows that count, for each joint, (n_j,)."""
        return tuple(np.flatnonzero(column) for column in self.used.T)

    @cached_property
    def bodies(self) -> tuple[np.ndarray, ...]:
        """Columns of the base parameters in these rows, transposed, for each joint, (r, n_j)."""
        return tuple(np.ascontiguousarray(self.rigid[rows, j].T) for j, rows in enumerate(self.lines))

    @cached_property
    def size(self) -> np.ndarray:
        """RMS effort of each joint over its rows, (m,)."""
        each = zip(self.effort.T, self.lines, strict=True)
        return np.array([np.sqrt(np.mean(x[rows] ** 2)) if len(rows) else 0.0 for x, rows in each])


def collect_rows(
    robot: Robot, motions: Sequence[TreeMotion], *, width: float = 0.0, base: BaseParameters | None = None
) -> TreeRows:
    """Collect the rows of `motions` of a `robot`.

    `width` is that of the smooth sign of friction, 0 for the true sign [rad/s; m/s].
    """
    if not motions:
        raise IdentificationError('no recording is marked use = "fit"; at least one must be')
    base = find_base_parameters(robot) if base is None else base
    q, v, a, effort, moving = (
        np.concatenate([getattr(x, name) for x in motions])
        for name in ("position", "velocity", "acceleration", "effort", "moving")
    )
    numbered, first = [], 0
    for motion in motions:
        numbered.append(np.where(motion.segment >= 0, motion.segment + first, -1))
        first += int(motion.segment.max(initial=-1)) + 1
    segment = np.concatenate(numbered)
    used = moving & (segment >= 0)[:, None]
    still = [name for name, column in zip(robot.names, used.T, strict=True) if not column.any()]
    if still:
        raise IdentificationError(
            f"joint {still[0]!r} never moves in {', '.join(sorted({x.recording for x in motions}))}: expected motion "
            "of every joint; record one in which it moves, or weld it in the robot's description"
        )
    turns = np.asarray(robot.turns)
    return TreeRows(
        robot=robot,
        base=base,
        width=width,
        position=q,
        velocity=v,
        effort=effort,
        used=used,
        segment=segment,
        stretch=np.repeat(np.arange(len(motions)), [len(x) for x in motions]),
        rigid=rigid_columns(robot, q, v, a)[:, :, base.chosen],
        turned=q @ turns.T,
        turning=v @ turns.T,
        motions=tuple(motions),
    )


@dataclass(frozen=True)
class TreeModel:
    """A model of a robot that can be fitted: base parameters, friction terms of each joint, and ripples."""

    robot: Robot
    base: BaseParameters
    families: tuple[tuple[str, ...], ...]  # friction terms of each joint
    speeds: Mapping[int, float] | None = None  # Stribeck velocity of each joint with a Stribeck term [rad/s; m/s]
    ripples: tuple[Ripple, ...] = ()  # ripples with given motors and orders; their amplitudes are fitted

    def __post_init__(self):
        check_families(self.families, self.robot.names, self.robot.shared)

    @cached_property
    def parts(self) -> tuple[FrictionPart, ...]:
        """All friction coefficients."""
        speeds = self.speeds or {}
        own = [
            FrictionPart(k, False, n, speeds[k] if n == STRIBECK_FRICTION.name else np.nan)
            for k, family in enumerate(self.families)
            for n in coefficient_names(family)
        ]
        return (
            *own,
            *(FrictionPart(i, True, n) for i in self.robot.shared for n in coefficient_names(self.families[i], True)),
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters: base parameters, friction, ripples."""
        joint = self.robot.names
        friction = (f"{joint[x.joint]}.{MOTOR_PREFIX if x.of_motor else ''}{x.number}" for x in self.parts)
        ripples = (f"{joint[x.motor]}.ripple_{part}" for x in self.ripples for part in ("sine", "cosine"))
        return (*self.base.names, *friction, *ripples)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """SI units of all parameters."""
        slides = self.robot.prismatic
        of_joint = dict(zip(self.robot.names, slides, strict=True))
        rigid = [rigid_unit(name, of_joint) for name in self.base.names]
        friction = [FRICTION_COEFFICIENTS[x.number].unit[slides[x.joint]] for x in self.parts]
        return (*rigid, *friction, *(self.robot.units[x.motor][1] for x in self.ripples for _ in range(2)))

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper physical bounds, (p,) each: friction is dissipative, rotor inertias are not negative."""
        p, r = len(self.names), len(self.base.names)
        lower, upper = np.full(p, -np.inf), np.full(p, np.inf)
        for i, name in enumerate(self.base.names):
            if name.endswith((".rotor_inertia", ".motor_inertia")):
                lower[i] = 0.0
        for i, part in enumerate(self.parts, r):
            lower[i], upper[i] = FRICTION_COEFFICIENTS[part.number].lower, FRICTION_COEFFICIENTS[part.number].upper
        return lower, upper

    @cached_property
    def loads(self) -> dict[int, int]:
        """Index of the load coefficient of each joint that has one."""
        r = len(self.base.names)
        return {x.joint: r + i for i, x in enumerate(self.parts) if FRICTION_COEFFICIENTS[x.number].grows_with_load}

    def alpha(self, values: np.ndarray) -> np.ndarray:
        """Return the load coefficients of all joints, (m,), from `values`, (p,)."""
        found = np.zeros(len(self.robot.names))
        for k, place in self.loads.items():
            found[k] = values[place]
        return found


def rigid_unit(name: str, slides: Mapping[str, bool]) -> str:
    """Return the SI unit of a parameter of a link, a rotor or a motor; `slides` tells which joints are prismatic."""
    owner, _, number = name.removesuffix(".regrouped").rpartition(".")
    if owner in slides and number.endswith("_inertia"):
        return ROTOR_INERTIA_UNITS[slides[owner]]
    return {"mas": "kg", "mom": "kg*m"}.get(number[:3], "kg*m^2")


@dataclass(frozen=True, eq=False)
class LinearisedModel:
    """A model linearised in the rows of each joint."""

    model: TreeModel
    rows: TreeRows
    places: tuple[np.ndarray, ...]  # indices of the parameters that enter each joint's rows, (c,)
    columns: tuple[np.ndarray, ...]  # columns of these parameters, (n_j, c)
    targets: tuple[np.ndarray, ...]  # effort that these columns are to explain, (n_j,)

    def residuals(self, values: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the residual of each joint, (n_j,), at `values`, (p,)."""
        each = zip(self.places, self.columns, self.targets, strict=True)
        return tuple(target - x @ values[place] for place, x, target in each)


def compute_loads(rows: TreeRows, model: TreeModel, values: np.ndarray) -> np.ndarray:
    """Return the effort of links, rotors and motor inertias in every row, (N, m), at `values`, (p,)."""
    return rows.rigid @ values[: len(model.base.names)]


def linearise_rows(
    model: TreeModel, rows: TreeRows, load: np.ndarray | None = None, alpha: np.ndarray | None = None
) -> LinearisedModel:
    """Linearise the model about loads, (N, m), and load coefficients, (m,), by default 0."""
    r, turns = len(model.base.names), np.asarray(rows.robot.turns)
    places, columns, targets = [], [], []
    for j, (lines, bodies) in enumerate(zip(rows.lines, rows.bodies, strict=True)):
        target = rows.effort[lines, j]
        y = np.zeros(len(lines)) if load is None else load[lines, j]
        if alpha is not None and alpha[j]:
            s = rows.friction(FrictionPart(j, False, COULOMB_FRICTION.name))[lines]
            bodies = bodies * (1.0 + alpha[j] * s * np.sign(y))
            target = target + alpha[j] * np.abs(y) * s
        place, made = list(range(r)), []
        for i, part in enumerate(model.parts, r):
            ratio = turns[part.joint, j] if part.of_motor else float(part.joint == j)
            if not ratio:
                continue
            place.append(i)
            grows = FRICTION_COEFFICIENTS[part.number].grows_with_load
            made.append(rows.friction(part)[lines] * (np.abs(y) if grows else ratio))
        for i, ripple in enumerate(model.ripples):
            ratio = turns[ripple.motor, j]
            if ratio:
                phase = ripple.order * rows.turned[lines, ripple.motor]
                at = r + len(model.parts) + 2 * i
                place += [at, at + 1]
                made += [ratio * np.sin(phase), ratio * np.cos(phase)]
        places.append(np.array(place))
        columns.append(np.vstack([bodies, *made]).T)
        targets.append(target)
    return LinearisedModel(model, rows, tuple(places), tuple(columns), tuple(targets))


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations by segment and joint. Sums of their slices are the normal equations of any subset."""

    gram: np.ndarray  # products of columns, (S, m, p, p)
    moment: np.ndarray  # products of columns and targets, (S, m, p)
    square: np.ndarray  # squared targets, (S, m)
    count: np.ndarray  # number of rows, (S, m)

    def total(self) -> NormalEquations:
        """Return the sums over all segments, as one segment."""
        return NormalEquations(*(x.sum(axis=0, keepdims=True) for x in self._all))

    def minus(self, other: NormalEquations) -> NormalEquations:
        """Subtract the sums of a part."""
        return NormalEquations(*(x - y for x, y in zip(self._all, other._all, strict=True)))

    def of_segments(self, numbers: np.ndarray) -> NormalEquations:
        """Return the sums of some segments."""
        return NormalEquations(*(x[numbers] for x in self._all))

    def segment(self, number: int) -> NormalEquations:
        """Return the sums of one segment."""
        return self.of_segments(np.array([number]))

    def of(self, places: np.ndarray) -> NormalEquations:
        """Return the sums for some of the parameters."""
        gram = self.gram[:, :, places[:, None], places]
        return NormalEquations(gram, self.moment[:, :, places], self.square, self.count)

    @property
    def _all(self) -> tuple[np.ndarray, ...]:
        return self.gram, self.moment, self.square, self.count

    def squares(self, values: np.ndarray) -> np.ndarray:
        """Return the sum of squared residuals of each segment and joint, (S, m), at `values`, (p,)."""
        left = self.square - 2.0 * self.moment @ values + (self.gram @ values) @ values
        return np.maximum(left, 0.0)


def sum_normal_equations(at: LinearisedModel, apart: bool = True) -> NormalEquations:
    """Sum the normal equations of each segment, or of all as one unless `apart`."""
    rows, p = at.rows, len(at.model.names)
    count = rows.segments if apart else 1
    m = len(rows.robot.names)
    gram, moment = np.zeros((count, m, p, p)), np.zeros((count, m, p))
    square, number = np.zeros((count, m)), np.zeros((count, m))
    for j, (place, x, target) in enumerate(zip(at.places, at.columns, at.targets, strict=True)):
        segment = rows.segment[rows.lines[j]] if apart else np.zeros(len(x), int)
        for s in np.unique(segment):
            mine = segment == s if apart else slice(None)
            own, wanted = x[mine], target[mine]
            gram[s, j][np.ix_(place, place)] = own.T @ own
            moment[s, j, place] = own.T @ wanted
            square[s, j] = wanted @ wanted
            number[s, j] = len(wanted)
    return NormalEquations(gram, moment, square, number)


@dataclass(frozen=True, eq=False)
class TreeSolution:
    """Result of a least-squares fit."""

    values: np.ndarray  # parameters, (p,)
    sd: np.ndarray  # residual standard deviation of each joint, (m,)
    seen: np.ndarray  # mask of the parameters that the rows determine, (p,)
    held: np.ndarray  # mask of the parameters on a bound, (p,)


def solve_normal_equations(
    equations: NormalEquations,
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    floor: np.ndarray,
    sd: np.ndarray | None = None,
    rounds: int = REGRESSION_SETTINGS.weight_round_count,
) -> TreeSolution:
    """Solve normal equations with joints weighted by their residual standard deviation.

    The weights start from `sd`, (m,), or equal, and are updated in `rounds`. No standard deviation is taken to be less
    than its `floor`, (m,).
    """
    whole = equations.total()
    sd = np.ones(whole.gram.shape[1]) if sd is None else sd
    values, seen, held = _solve_weighted(whole, sd, bounds)
    for _ in range(rounds):
        sd = np.maximum(np.sqrt(whole.squares(values)[0] / np.maximum(whole.count[0], 1.0)), floor)
        values, seen, held = _solve_weighted(whole, sd, bounds)
    return TreeSolution(values, sd, seen, held)


def _solve_weighted(
    whole: NormalEquations, sd: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve bounded weighted least squares; return values, determined parameters and those on a bound, each (p,)."""
    weight = 1.0 / sd**2
    gram, moment = np.tensordot(weight, whole.gram[0], 1), weight @ whole.moment[0]
    size = np.sqrt(np.diag(gram))
    seen = determined_parameters(gram)
    at = np.flatnonzero(seen)
    scale = 1.0 / size[at]
    unit = gram[np.ix_(at, at)] * np.outer(scale, scale)
    values, held = np.zeros(len(gram)), np.zeros(len(gram), bool)
    found, held[at] = _solve_bounded(unit, moment[at] * scale, *(b[at] / scale for b in bounds))
    values[at] = found * scale
    return values, seen, held


def _solve_bounded(
    gram: np.ndarray, moment: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Minimise x'Gx/2 - m'x within bounds by an active-set method; return x, (p,), and a mask of active bounds."""
    held = np.zeros(len(moment), bool)
    for _ in range(REGRESSION_SETTINGS.max_active_sets):
        x = np.zeros(len(moment))
        x[held] = np.where(np.isfinite(lower), lower, upper)[held]
        free = np.flatnonzero(~held)
        x[free] = np.linalg.solve(gram[np.ix_(free, free)], moment[free] - gram[np.ix_(free, held)] @ x[held])
        out = (x < lower - 1e-12) | (x > upper + 1e-12)
        if out.any():
            if np.any(out & (x > upper)):
                break  # an upper bound is violated, which is rare and left to a general bounded search
            held |= out
            continue
        pull = moment - gram @ x
        inwards = held & (pull > 1e-10 * (1.0 + np.abs(moment)))
        if not inwards.any():
            return x, held
        held[np.argmax(np.where(inwards, pull, -np.inf))] = False
    root = np.linalg.cholesky(gram)
    x = least_squares_within(root.T, np.linalg.solve(root, moment), lower, upper)
    return x, (x <= lower + 1e-9) | (x >= upper - 1e-9)


def weight_joints(equations: NormalEquations, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sum normal equations over joints with weights 1 / `sd`^2, (m,).

    Returns the gram matrices, (S, p, p), moments, (S, p), and squares, (S,), of each segment.
    """
    weight = 1.0 / sd**2
    gram = np.einsum("j,sjpq->spq", weight, equations.gram)
    return gram, np.einsum("j,sjp->sp", weight, equations.moment), equations.square @ weight


def plain_solution(gram: np.ndarray, moment: np.ndarray, ridge: float = 1e-12) -> np.ndarray:
    """Solve normal equations without bounds, scaled to a unit diagonal; (p,) or (p, k), as `moment`.

    With a `ridge` on that diagonal, undetermined parameters are 0.
    """
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    unit = gram / np.outer(size, size) + ridge * np.eye(len(gram))
    return (np.linalg.solve(unit, (moment.T / size).T).T / size).T


def left_out_losses(equations: NormalEquations, sd: np.ndarray) -> np.ndarray:
    """Return the loss on each segment, (S,), of a fit to the others, with joints weighted by 1 / `sd`^2, (m,)."""
    return left_out_joint_losses(equations, sd).sum(axis=1)


def left_out_joint_losses(equations: NormalEquations, sd: np.ndarray) -> np.ndarray:
    """Return the loss of each joint on each segment, (S, m), of a fit to the others; see `left_out_losses`."""
    gram, moment, square = weight_joints(equations, sd)
    whole, target = gram.sum(axis=0), moment.sum(axis=0)
    losses = np.zeros(equations.square.shape)
    for s, (g, m, q) in enumerate(zip(gram, moment, square, strict=True)):
        if q > 0.0:
            x = plain_solution(whole - g, target - m)
            missed = equations.square[s] - 2.0 * equations.moment[s] @ x + (equations.gram[s] @ x) @ x
            losses[s] = missed / sd**2
    return losses


def determined_parameters(gram: np.ndarray) -> np.ndarray:
    """Return a mask, (p,), of the parameters that a gram matrix, (p, p), determines: as many as its rank."""
    from scipy.linalg import lapack

    size = np.sqrt(np.diag(gram))
    some = size > 1e-12 * size.max()
    at = np.flatnonzero(some)
    unit = gram[np.ix_(at, at)] / np.outer(size[at], size[at])
    try:
        np.linalg.cholesky(unit - REGRESSION_SETTINGS.min_squared_remainder * np.eye(len(at)))
        return some
    except np.linalg.LinAlgError:
        pass
    _, pivot, rank, _ = lapack.dpstrf(unit, tol=REGRESSION_SETTINGS.min_squared_remainder, lower=1)
    seen = np.zeros(len(gram), bool)
    seen[at[pivot[:rank] - 1]] = True
    return seen


def fit_rows(
    model: TreeModel,
    rows: TreeRows,
    *,
    load: np.ndarray | None = None,
    start: TreeSolution | None = None,
) -> tuple[TreeSolution, LinearisedModel]:
    """Fit a `model` over `rows` by weighted least squares.

    The first `load`, (N, m), is by default that of `start` or of a fit without load terms.
    """
    # Lower limit of each joint's residual standard deviation in its weight.
    floor = REGRESSION_SETTINGS.min_residual_share * rows.size
    if not model.loads:
        at = linearise_rows(model, rows)
        return solve_normal_equations(sum_normal_equations(at, apart=False), model.bounds, floor=floor), at
    rounds = REGRESSION_SETTINGS.weight_round_count
    alpha, sd = (None, None) if start is None else (model.alpha(start.values), start.sd)
    if load is None:
        if start is None:
            plain = tuple(tuple(t for t in family if t != LOAD_FEATURE) for family in model.families)
            load = compute_loads(rows, bare := replace(model, families=plain), fit_rows(bare, rows)[0].values)
        else:
            load = compute_loads(rows, model, start.values)
    for step in range(REGRESSION_SETTINGS.max_steps):
        at = linearise_rows(model, rows, load, alpha)
        found = solve_normal_equations(
            sum_normal_equations(at, apart=False), model.bounds, floor=floor, sd=sd, rounds=rounds
        )
        before, load = load, compute_loads(rows, model, found.values)
        moved = np.sqrt(np.mean((load - before) ** 2, axis=0)) + np.abs(
            model.alpha(found.values) - (0.0 if alpha is None else alpha)
        ) * np.sqrt(np.mean(load**2, axis=0))
        alpha, sd, rounds = model.alpha(found.values), found.sd, 1
        if step and np.all(moved <= REGRESSION_SETTINGS.load_change_tolerance * np.maximum(rows.size, 1e-12)):
            break
    return found, linearise_rows(model, rows, load, alpha)
