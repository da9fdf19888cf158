r"""Least squares for all joints of a robot at once: one set of numbers, rows of every joint, weights for each.

.. math::
   \tau_j = y_j + \alpha_j |y_j|\,s_j + \sum_t c_{jt}\,\varphi_t(v_j) + \sum_i T_{ij} f_i(c_i), \qquad y = Y_1\beta

with friction as the core has it (`include/pellucid/friction.hpp`): proportional to the load y that passes, which
bodies, rotors and motors' inertias make. All but alpha is linear. With alpha the model is solved by Gauss and Newton:
its Jacobian has rows of Y_1 times 1 + alpha s sign(y), and |y| s; the first step has alpha = 0 and the y of a fit
without.

Rows are grouped by segment and joint, and so are their normal equations: to leave a segment out is a subtraction, and
to weigh joints a sum of few small matrices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..._errors import IdentificationError
from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion
from ..regression import least_squares_within
from .base_parameters import BaseParameters, base_parameters, rigid_columns
from .friction_terms import INERTIA, MOTOR, NUMBERS, check_families, direction, numbers_of
from .tree_estimate import Ripple

SINGULAR = 1e-9
"""Of a squared column of length 1, what others must leave of it so that recordings tell it."""
ROUNDS = 4  # of weights by residuals
ACTIVE_SETS = 60  # tried before a search takes over
STEPS = 12  # of Gauss and Newton, at most
SETTLED = 1e-4  # Of the RMS effort, the change at which they stop
LEAST_WEIGHT = 0.02
"""Of a joint's RMS effort: a residual is not taken for less."""


@dataclass(frozen=True, eq=False)
class TreeRows:
    """Rows of all recordings under one another: N rows, m joints, r base parameters.

    `segment` numbers segments of all recordings from 0; -1 belongs to none. `stretch` numbers recordings. `used` (N, m)
    are the rows that count.
    """

    robot: Robot
    base: BaseParameters
    width: float
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    used: np.ndarray
    segment: np.ndarray
    stretch: np.ndarray
    rigid: np.ndarray  # (N, m, r)
    turned: np.ndarray  # (N, m): motors' angles
    turning: np.ndarray  # and speeds

    @property
    def segments(self) -> int:
        """How many."""
        return int(self.segment.max(initial=-1)) + 1

    def only(self, segments: Sequence[int]) -> TreeRows:
        """The same with the rows of these segments counting alone."""
        return replace(self, used=self.used & np.isin(self.segment, segments)[:, None])

    @cached_property
    def lines(self) -> tuple[np.ndarray, ...]:
        """Of each joint, the rows that count."""
        return tuple(np.flatnonzero(column) for column in self.used.T)

    @cached_property
    def bodies(self) -> tuple[np.ndarray, ...]:
        """Of each joint, base parameters' columns of these rows, (r, n_j)."""
        return tuple(np.ascontiguousarray(self.rigid[rows, j].T) for j, rows in enumerate(self.lines))

    @cached_property
    def size(self) -> np.ndarray:
        """RMS effort of each joint over its rows, (m,)."""
        each = zip(self.effort.T, self.lines, strict=True)
        return np.array([np.sqrt(np.mean(x[rows] ** 2)) if len(rows) else 0.0 for x, rows in each])


def tree_rows(
    robot: Robot, motions: Sequence[TreeMotion], *, width: float = 0.0, base: BaseParameters | None = None
) -> TreeRows:
    """Rows of `motions` of a `robot`; `width` of the smooth sign of friction, 0 for the true sign [rad/s; m/s]."""
    if not motions:
        raise IdentificationError('no recording is marked use = "fit"; at least one must be')
    base = base_parameters(robot) if base is None else base
    q, v, a, effort, moving = (
        np.concatenate([getattr(x, name) for x in motions])
        for name in ("position", "velocity", "acceleration", "effort", "moving")
    )
    segment, first = [], 0
    for motion in motions:
        segment.append(np.where(motion.segment >= 0, motion.segment + first, -1))
        first += int(motion.segment.max(initial=-1)) + 1
    segment = np.concatenate(segment)
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
    )


class Part(NamedTuple):
    """A coefficient of friction: of a joint, or of the motor of its number; its Stribeck speed, if it has one."""

    joint: int
    of_motor: bool
    number: str
    speed: float = float("nan")


@dataclass(frozen=True)
class TreeModel:
    """What is fitted: friction families of each joint, the speeds of their Stribeck terms, ripples of their orders."""

    robot: Robot
    base: BaseParameters
    families: tuple[tuple[str, ...], ...]
    speeds: Mapping[int, float] | None = None  # Of joints with a Stribeck term [rad/s; m/s]
    ripples: tuple[Ripple, ...] = ()  # Their motors and orders are taken from here, their sizes fitted

    def __post_init__(self):
        check_families(self.families, self.robot.names, self.robot.shared)

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Every coefficient of friction."""
        speeds = self.speeds or {}
        own = [
            Part(k, False, n, speeds[k] if n == "stribeck" else np.nan)
            for k, family in enumerate(self.families)
            for n in numbers_of(family)
        ]
        return (*own, *(Part(i, True, n) for i in self.robot.shared for n in numbers_of(self.families[i], True)))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of all parameters: base, friction, ripples."""
        joint = self.robot.names
        friction = (f"{joint[x.joint]}.{MOTOR if x.of_motor else ''}{x.number}" for x in self.parts)
        ripples = (f"{joint[x.motor]}.ripple_{part}" for x in self.ripples for part in ("sine", "cosine"))
        return (*self.base.names, *friction, *ripples)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """SI units of them."""
        slides = self.robot.prismatic
        of_joint = dict(zip(self.robot.names, slides, strict=True))
        rigid = [rigid_unit(name, of_joint) for name in self.base.names]
        friction = [NUMBERS[x.number].unit[slides[x.joint]] for x in self.parts]
        return (*rigid, *friction, *(self.robot.units[x.motor][1] for x in self.ripples for _ in range(2)))

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Physical ones, (p,) each: friction never drives, what a rotor adds is not negative."""
        p, r = len(self.names), len(self.base.names)
        lower, upper = np.full(p, -np.inf), np.full(p, np.inf)
        for i, name in enumerate(self.base.names):
            if name.endswith((".rotor_inertia", ".motor_inertia")):
                lower[i] = 0.0
        for i, part in enumerate(self.parts, r):
            lower[i], upper[i] = NUMBERS[part.number].lower, NUMBERS[part.number].upper
        return lower, upper

    @cached_property
    def loads(self) -> dict[int, int]:
        """Where the load coefficient of a joint stands."""
        r = len(self.base.names)
        return {x.joint: r + i for i, x in enumerate(self.parts) if x.number == "load"}

    def alpha(self, values: np.ndarray) -> np.ndarray:
        """Load coefficients of all joints, (m,), of `values`, (p,)."""
        found = np.zeros(len(self.robot.names))
        for k, place in self.loads.items():
            found[k] = values[place]
        return found


def rigid_unit(name: str, slides: Mapping[str, bool]) -> str:
    """SI unit of a number of a body, a rotor or a motor, whose joint `slides` or turns."""
    owner, _, number = name.removesuffix(".regrouped").rpartition(".")
    if owner in slides and number.endswith("_inertia"):
        return INERTIA[slides[owner]]
    return {"mas": "kg", "mom": "kg*m"}.get(number[:3], "kg*m^2")


@dataclass(frozen=True, eq=False)
class Linearised:
    """Of each joint: which parameters its rows know, (c,), their columns (n_j, c), what these are to make, (n_j,)."""

    model: TreeModel
    rows: TreeRows
    places: tuple[np.ndarray, ...]
    columns: tuple[np.ndarray, ...]
    targets: tuple[np.ndarray, ...]

    def residuals(self, values: np.ndarray) -> tuple[np.ndarray, ...]:
        """Of each joint, (n_j,)."""
        each = zip(self.places, self.columns, self.targets, strict=True)
        return tuple(target - x @ values[place] for place, x, target in each)


def loads_of(rows: TreeRows, model: TreeModel, values: np.ndarray) -> np.ndarray:
    """What bodies, rotors and motors' inertias need in every row, (N, m), by `values`, (p,)."""
    return rows.rigid @ values[: len(model.base.names)]


def linearised(
    model: TreeModel, rows: TreeRows, load: np.ndarray | None = None, alpha: np.ndarray | None = None
) -> Linearised:
    """The model about loads (N, m) and load coefficients (m,); without these, 0."""
    r, turns = len(model.base.names), np.asarray(rows.robot.turns)
    places, columns, targets = [], [], []
    for j, (lines, bodies) in enumerate(zip(rows.lines, rows.bodies, strict=True)):
        v, target = rows.velocity[lines, j], rows.effort[lines, j]
        y = np.zeros(len(lines)) if load is None else load[lines, j]
        if alpha is not None and alpha[j]:
            s = direction(v, rows.width)
            bodies = bodies * (1.0 + alpha[j] * s * np.sign(y))
            target = target + alpha[j] * np.abs(y) * s
        place, made = list(range(r)), []
        for i, (k, of_motor, number, own) in enumerate(model.parts, r):
            ratio = turns[k, j] if of_motor else float(k == j)
            if not ratio:
                continue
            column = NUMBERS[number].column(rows.turning[lines, k] if of_motor else v, rows.width, own)
            place.append(i)
            made.append(column * (np.abs(y) if number == "load" else ratio))
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
    return Linearised(model, rows, tuple(places), tuple(columns), tuple(targets))


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Sums over the rows of each segment and joint: `gram` (S, m, p, p), `moment` (S, m, p), `square` (S, m) of what
    columns and targets make, `count` (S, m) rows. Slices of them add up to whatever is fitted."""

    gram: np.ndarray
    moment: np.ndarray
    square: np.ndarray
    count: np.ndarray

    def total(self) -> NormalEquations:
        """Over all segments, as if they were one."""
        return NormalEquations(*(x.sum(axis=0, keepdims=True) for x in self._all))

    def minus(self, other: NormalEquations) -> NormalEquations:
        """What is left of a sum without one of its parts."""
        return NormalEquations(*(x - y for x, y in zip(self._all, other._all, strict=True)))

    def of_segments(self, numbers: np.ndarray) -> NormalEquations:
        """Of some segments alone."""
        return NormalEquations(*(x[numbers] for x in self._all))

    def segment(self, number: int) -> NormalEquations:
        """Of one segment alone."""
        return self.of_segments(np.array([number]))

    def of(self, places: np.ndarray) -> NormalEquations:
        """For some of the parameters alone."""
        gram = self.gram[:, :, places[:, None], places]
        return NormalEquations(gram, self.moment[:, :, places], self.square, self.count)

    @property
    def _all(self) -> tuple[np.ndarray, ...]:
        return self.gram, self.moment, self.square, self.count

    def squares(self, values: np.ndarray) -> np.ndarray:
        """Sum of squared residuals of each segment and joint, (S, m)."""
        left = self.square - 2.0 * self.moment @ values + (self.gram @ values) @ values
        return np.maximum(left, 0.0)


def normal_equations(
    at: Linearised, weights: Sequence[np.ndarray] | None = None, apart: bool = True
) -> NormalEquations:
    """Of each segment, or of all as one; `weights` (n_j,) of squares."""
    rows, p = at.rows, len(at.model.names)
    count = rows.segments if apart else 1
    m = len(rows.robot.names)
    gram, moment = np.zeros((count, m, p, p)), np.zeros((count, m, p))
    square, number = np.zeros((count, m)), np.zeros((count, m))
    for j, (place, x, target) in enumerate(zip(at.places, at.columns, at.targets, strict=True)):
        segment = rows.segment[rows.lines[j]] if apart else np.zeros(len(x), int)
        w = np.ones(len(x)) if weights is None else weights[j]
        for s in np.unique(segment):
            mine = segment == s if apart else slice(None)
            own, wanted = x[mine], target[mine]
            weighted = own if weights is None else own * w[mine][:, None]
            gram[s, j][np.ix_(place, place)] = weighted.T @ own
            moment[s, j, place] = weighted.T @ wanted
            square[s, j] = wanted @ (wanted if weights is None else w[mine] * wanted)
            number[s, j] = w[mine].sum() if weights is not None else len(wanted)
    return NormalEquations(gram, moment, square, number)


@dataclass(frozen=True, eq=False)
class TreeSolution:
    """Where a fit ended: `values` (p,), `sd` (m,) of each joint's residual, which parameters the rows tell, `seen`
    (p,), which a bound holds, `held` (p,)."""

    values: np.ndarray
    sd: np.ndarray
    seen: np.ndarray
    held: np.ndarray
    iterations: int = 1
    converged: bool = True


def solved(
    equations: NormalEquations,
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    floor: np.ndarray,
    sd: np.ndarray | None = None,
    rounds: int = ROUNDS,
) -> TreeSolution:
    """Of all the rows of `equations`: joints weigh as 1 / sd of their residual, found in so many `rounds` from a first
    `sd`, (m,), or from all alike; 0 rounds leave them. No sd is taken for less than its `floor`, (m,)."""
    whole = equations.total()
    sd = np.ones(whole.gram.shape[1]) if sd is None else sd
    values, seen, held = _weighted(whole, sd, bounds)
    for _ in range(rounds):
        sd = np.maximum(np.sqrt(whole.squares(values)[0] / np.maximum(whole.count[0], 1.0)), floor)
        values, seen, held = _weighted(whole, sd, bounds)
    if not rounds:
        sd = np.sqrt(whole.squares(values)[0] / np.maximum(whole.count[0], 1.0))
    return TreeSolution(values, sd, seen, held)


def _weighted(
    whole: NormalEquations, sd: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values (p,) of weighted least squares within bounds; which are seen, which are held."""
    weight = 1.0 / sd**2
    gram, moment = np.tensordot(weight, whole.gram[0], 1), weight @ whole.moment[0]
    size = np.sqrt(np.diag(gram))
    seen = told(gram)
    at = np.flatnonzero(seen)
    scale = 1.0 / size[at]
    unit = gram[np.ix_(at, at)] * np.outer(scale, scale)
    values, held = np.zeros(len(gram)), np.zeros(len(gram), bool)
    found, held[at] = _bounded(unit, moment[at] * scale, *(b[at] / scale for b in bounds))
    values[at] = found * scale
    return values, seen, held


def _bounded(
    gram: np.ndarray, moment: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The x, (p,), where x'Gx/2 - m'x is least within bounds, and which of them hold it; by an active set."""
    held = np.zeros(len(moment), bool)
    for _ in range(ACTIVE_SETS):
        x = np.zeros(len(moment))
        x[held] = np.where(np.isfinite(lower), lower, upper)[held]
        free = np.flatnonzero(~held)
        x[free] = np.linalg.solve(gram[np.ix_(free, free)], moment[free] - gram[np.ix_(free, held)] @ x[held])
        out = (x < lower - 1e-12) | (x > upper + 1e-12)
        if out.any():
            if np.any(out & (x > upper)):
                break  # two bounds of one number: rare, and left to a search that knows both
            held |= out
            continue
        pull = moment - gram @ x
        inwards = held & (pull > 1e-10 * (1.0 + np.abs(moment)))
        if not inwards.any():
            return x, held
        held[np.argmax(np.where(inwards, pull, -np.inf))] = False
    root = np.linalg.cholesky(gram)
    x = least_squares_within(root.T, np.linalg.solve(root, moment), lower, upper, method="bvls")
    return x, (x <= lower + 1e-9) | (x >= upper - 1e-9)


def weighed(equations: NormalEquations, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each segment, all joints together, each by 1 / `sd`^2, (m,): (S, p, p), (S, p), (S,)."""
    weight = 1.0 / sd**2
    gram = np.einsum("j,sjpq->spq", weight, equations.gram)
    return gram, np.einsum("j,sjp->sp", weight, equations.moment), equations.square @ weight


def plain_solution(gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Least squares of normal equations without bounds, (p, k) for `moment` (p, k); what nothing tells is 0."""
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    unit = gram / np.outer(size, size) + 1e-12 * np.eye(len(gram))
    return (np.linalg.solve(unit, (moment.T / size).T).T / size).T


def left_out_losses(equations: NormalEquations, sd: np.ndarray) -> np.ndarray:
    """Sum of squares on each segment, (S,), by least squares over the others; joints weighed by `sd`, (m,)."""
    gram, moment, square = weighed(equations, sd)
    whole, target = gram.sum(axis=0), moment.sum(axis=0)
    losses = np.zeros(len(gram))
    for s, (g, m, q) in enumerate(zip(gram, moment, square, strict=True)):
        if q > 0.0:
            x = plain_solution(whole - g, target - m)
            losses[s] = q - 2.0 * m @ x + x @ g @ x
    return losses


def told(gram: np.ndarray) -> np.ndarray:
    """Which parameters the rows of a `gram` (p, p) tell, (p,) bool: as many as its rank, by pivoting."""
    from scipy.linalg import lapack

    size = np.sqrt(np.diag(gram))
    some = size > 1e-12 * size.max()
    at = np.flatnonzero(some)
    unit = gram[np.ix_(at, at)] / np.outer(size[at], size[at])
    try:
        np.linalg.cholesky(unit - SINGULAR * np.eye(len(at)))
        return some
    except np.linalg.LinAlgError:
        pass
    _, pivot, rank, _ = lapack.dpstrf(unit, tol=SINGULAR, lower=1)
    seen = np.zeros(len(gram), bool)
    seen[at[pivot[:rank] - 1]] = True
    return seen


def floor_of(rows: TreeRows) -> np.ndarray:
    """Least standard deviation that a joint's residual is taken for, (m,)."""
    return LEAST_WEIGHT * rows.size


def fit_rows(
    model: TreeModel,
    rows: TreeRows,
    *,
    load: np.ndarray | None = None,
    weights: Sequence[np.ndarray] | None = None,
    rounds: int = ROUNDS,
    start: TreeSolution | None = None,
) -> tuple[TreeSolution, Linearised]:
    """Weighted least squares of a `model` over `rows`, (n_j,) `weights` of whose squares beside those of joints; its
    first loads (N, m) those of a fit without load terms, if not given, or of `start`."""
    floor = floor_of(rows)
    if not model.loads:
        at = linearised(model, rows)
        return solved(normal_equations(at, weights, apart=False), model.bounds, floor=floor, rounds=rounds), at
    if start is None and load is None:
        plain = tuple(tuple(t for t in family if t != "load") for family in model.families)
        load = loads_of(rows, bare := replace(model, families=plain), fit_rows(bare, rows)[0].values)
    values = None if start is None else start.values
    alpha, sd = (None, None) if start is None else (model.alpha(values), start.sd)
    load = loads_of(rows, model, values) if load is None else load
    for step in range(1, STEPS + 1):
        at = linearised(model, rows, load, alpha)
        found = solved(normal_equations(at, weights, apart=False), model.bounds, floor=floor, sd=sd, rounds=rounds)
        before, load = load, loads_of(rows, model, found.values)
        moved = np.sqrt(np.mean((load - before) ** 2, axis=0)) + np.abs(
            model.alpha(found.values) - (0.0 if alpha is None else alpha)
        ) * np.sqrt(np.mean(load**2, axis=0))
        alpha, sd, rounds = model.alpha(found.values), found.sd, min(rounds, 1)
        converged = step > 1 and bool(np.all(moved <= SETTLED * np.maximum(rows.size, 1e-12)))
        if converged:
            break
    return replace(found, iterations=step, converged=converged), linearised(model, rows, load, alpha)
