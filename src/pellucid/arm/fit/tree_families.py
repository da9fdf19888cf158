r"""Choose the friction terms of each joint, and the drive ripple, tested on left-out segments.

**Terms** are chosen by forward selection. The search starts from plain friction and tries every further term of every
joint. Each segment is predicted by a fit to the others. A term reduces the loss of segment s by :math:`D_s = \sum_j
(e_{js}^2 - e'^2_{js})/\sigma_j^2`. If the term were useless, each D_s could as well have the other sign. A term
qualifies if the share of all choices of signs with no smaller total is below `max_term_p_value`, if its coefficient is
physical, and if it saves at least the share `min_improvement` of the error of its joint. The qualifying term with the
largest reduction is added, and the search continues. Only the given rows take part, so cross-validation can repeat the
choice.

The loads are those of the plain fit to all rows, and Stribeck speeds come from a grid. All terms are then columns of
one set of normal equations, kept by segment, and trying a term means adding a row to a solved system.

**Ripple** is effort that is periodic in the motor's angle, with an order that is not known beforehand.

Cogging, gear teeth and eccentric bearings make an effort that repeats with the motor's angle. Its order need not be a
whole number, because intermediate shafts of a gear turn at other ratios. The power spectrum of each joint's residual
over that angle is searched. The orders range from a few periods in the travelled range up to what the rows can resolve.
Each order is compared with the median of its neighbours. With m independent orders and a line x times the neighbours'
mean, noise has such a line somewhere with probability

.. math::
   p = 1 - (1 - e^{-x})^m .

Errors of the rigid-body or friction model spread over neighbouring orders and make no line. A line with p below 1 % is
fitted by a sine and a cosine in the joint regression. It is kept if it also improves the prediction of left-out
segments, by the same test as friction terms.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...models.causes import ParallelSpring
from ...models.friction_terms import DIRECTIONAL_FEATURE, STRIBECK_FRICTION
from ...numerics.block_test import MIN_IMPROVEMENT, sign_flip_p_value
from ...numerics.searches.scalar_search import minimise_on_interval
from .friction_terms import FRICTION_COEFFICIENTS, FURTHER_MOTOR_TERMS, FURTHER_TERMS, TERM_COEFFICIENTS, plain_families
from .tree_estimate import Ripple
from .tree_regression import (
    FrictionPart,
    LinearisedModel,
    NormalEquations,
    TreeModel,
    TreeRows,
    TreeSolution,
    compute_loads,
    fit_rows,
    left_out_joint_losses,
    left_out_losses,
    linearise_rows,
    plain_solution,
    sum_normal_equations,
    weight_joints,
)


@dataclass(frozen=True)
class FamilyThresholds:
    """Thresholds of the choice of friction terms."""

    # A term is added only if its p value is below this level, at which Akaike's criterion adds one parameter. On 17
    # simulated robots of four joints, with no least improvement, the error on left-out segments is 2 % smaller than
    # with a level of 5 %. On ten of them it finds 32 of 53 terms instead of 21, and adds 10 false ones instead of 2.
    max_term_p_value: float = 0.157
    # Stribeck velocities that are tried, as shares of a joint's largest speed. With larger ones the term would change
    # the whole friction curve.
    stribeck_speed_shares: tuple[float, ...] = (0.25, 0.125, 0.0625, 0.03125)
    # Terms are chosen only with at least this many segments. With fewer, no choice of signs is rare enough.
    min_segments: int = 5


FAMILY_THRESHOLDS = FamilyThresholds()


@dataclass(frozen=True)
class AddedTerm:
    """A friction term that was added to a joint."""

    joint: int  # index of the joint
    term: str
    saved: float  # reduction of the loss on left-out segments [%]
    p_value: float
    speed: float = float("nan")  # Stribeck velocity of a Stribeck term [rad/s or m/s]


@dataclass(frozen=True)
class FamilyChoice:
    """Friction terms of each joint, and the order in which they were added."""

    families: tuple[tuple[str, ...], ...]  # terms of each joint
    speeds: dict[int, float]  # Stribeck velocity by joint [rad/s or m/s]
    taken: tuple[AddedTerm, ...]  # added terms in their order
    springs: Mapping[int, ParallelSpring] = field(default_factory=dict)  # springs in parallel to drives, by joint


@dataclass(frozen=True)
class _Candidate:
    """A term that may be added to a joint, with its coefficient."""

    joint: int
    term: str
    part: FrictionPart


@dataclass(frozen=True)
class _CandidateModel(TreeModel):
    """A model with plain friction and every candidate's column."""

    candidates: tuple[_Candidate, ...] = ()

    @cached_property
    def parts(self) -> tuple[FrictionPart, ...]:
        return (*TreeModel(self.robot, self.base, self.families).parts, *(c.part for c in self.candidates))


def choose_families(
    rows: TreeRows,
    terms: Sequence[str] = FURTHER_TERMS + FURTHER_MOTOR_TERMS,
    min_improvement: float = MIN_IMPROVEMENT,
    sprung: Collection[int] = (),
) -> FamilyChoice:
    """Choose the friction families of a robot's joints within `rows`; `terms` are tried in addition to plain ones.

    Drives of the joints `sprung` act in parallel to springs.
    A term must save at least the share `min_improvement` of the error with which left-out segments of its joint are
    predicted.
    """
    robot = rows.robot
    plain = TreeModel(robot, rows.base, plain_families(len(robot.names), robot.shared, sprung))
    start, _ = fit_rows(plain, rows)
    pool = _CandidateModel(robot, rows.base, plain.families, candidates=tuple(_candidates(rows, terms)))
    present = np.unique(rows.segment[rows.used.any(axis=1)])
    if len(present) < FAMILY_THRESHOLDS.min_segments or not pool.candidates:
        return FamilyChoice(plain.families, {}, ())
    equations = sum_normal_equations(linearise_rows(pool, rows, compute_loads(rows, plain, start.values)))
    equations = equations.of_segments(present)
    active = list(range(len(plain.names)))
    waiting = {len(plain.names) + i: c for i, c in enumerate(pool.candidates)}
    taken, sd = [], start.sd
    while waiting:
        gram, moment, _ = weight_joints(equations, sd)
        at = np.array(sorted(waiting))
        saved, physical = _loss_reductions(gram, moment, active, at, [waiting[i].part for i in at])
        losses = left_out_joint_losses(equations.of(np.array(active)), sd)
        least = (1.0 - (1.0 - min_improvement) ** 2) * losses.sum(axis=0)
        worth = []
        for place, each, fine in zip(at, saved.T, physical, strict=True):
            p = sign_flip_p_value(each)
            if fine and p < FAMILY_THRESHOLDS.max_term_p_value and each.sum() >= least[waiting[int(place)].joint]:
                worth.append((float(each.sum()), p, int(place)))
        if not worth:
            break
        most, p, place = max(worth)
        chosen = waiting[place]
        taken.append(AddedTerm(chosen.joint, chosen.term, 100.0 * most / losses.sum(), p, chosen.part.speed))
        active.append(place)
        waiting = {i: c for i, c in waiting.items() if (c.joint, c.term) != (chosen.joint, chosen.term)}
        sd = _residual_sd(equations, active, sd)
    families = [list(family) for family in plain.families]
    for each in taken:
        families[each.joint].append(each.term)
    speeds = {each.joint: each.speed for each in taken if each.term == STRIBECK_FRICTION.name}
    return FamilyChoice(tuple(map(tuple, families)), speeds, tuple(taken))


def _candidates(rows: TreeRows, terms: Sequence[str]) -> list[_Candidate]:
    """Return the candidate terms of all joints."""
    made = []
    for k in range(len(rows.robot.names)):
        for term in terms:
            if term.startswith("motor_"):
                if k in rows.robot.shared:
                    made.append(_Candidate(k, term, FrictionPart(k, True, term.removeprefix("motor_"))))
            elif term == STRIBECK_FRICTION.name:
                speed = np.abs(rows.velocity[rows.lines[k], k])
                slow = [
                    x * speed.max() for x in FAMILY_THRESHOLDS.stribeck_speed_shares if x * speed.max() > speed.min()
                ]
                made += [_Candidate(k, term, FrictionPart(k, False, term, float(x))) for x in slow]
            else:
                made.append(_Candidate(k, term, FrictionPart(k, False, TERM_COEFFICIENTS[term][0])))
    return made


def _loss_reductions(
    gram: np.ndarray, moment: np.ndarray, active: list[int], at: np.ndarray, parts: Sequence[FrictionPart]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the loss that each candidate `at`, (c,), saves on each left-out segment, (S, c), and which are physical.

    `active` are the columns of the current model. The second result is a mask, (c,).
    """
    a = np.array(active)
    whole, target = gram.sum(axis=0), moment.sum(axis=0)
    both = np.concatenate([a, at])
    saved = np.zeros((len(gram), len(at)))
    for s in range(-1, len(gram)):
        g, m = (whole, target) if s < 0 else (whole - gram[s], target - moment[s])
        beside = g[np.ix_(a, at)]
        found = plain_solution(g[np.ix_(a, a)], np.column_stack([m[a], beside]))
        values, ways = found[:, 0], found[:, 1:]
        left = np.diag(g)[at] - np.sum(beside * ways, axis=0)
        told = left > 1e-8 * np.diag(g)[at]
        step = np.where(told, (m[at] - beside.T @ values) / np.where(told, left, 1.0), 0.0)
        if s < 0:
            physical = told & np.array(
                [
                    p.number in TERM_COEFFICIENTS[DIRECTIONAL_FEATURE]
                    or FRICTION_COEFFICIENTS[p.number].lower <= x <= FRICTION_COEFFICIENTS[p.number].upper
                    for p, x in zip(parts, step, strict=True)
                ]
            )
            continue
        moved = np.vstack([-ways, np.eye(len(at))]) * step
        pull = gram[s][np.ix_(both, a)] @ values - moment[s][both]
        saved[s] = -2.0 * pull @ moved - np.sum(moved * (gram[s][np.ix_(both, both)] @ moved), axis=0)
    return saved, physical


def _residual_sd(equations: NormalEquations, active: list[int], sd: np.ndarray) -> np.ndarray:
    """Return the residual standard deviation of each joint, (m,), with the terms added so far."""
    a = np.array(active)
    gram, moment, _ = weight_joints(equations, sd)
    x = plain_solution(gram.sum(axis=0)[np.ix_(a, a)], moment.sum(axis=0)[a])
    whole = equations.of(a).total()
    return np.sqrt(whole.squares(x)[0] / np.maximum(whole.count[0], 1.0))


@dataclass(frozen=True)
class RippleThresholds:
    """Thresholds of the search for drive ripple."""

    max_line_p_value: float = 0.01  # a spectral line is fitted only if its p value is below this
    # A ripple must have at least this many periods within the travelled range. Links and gravity cause slower lines.
    min_periods: float = 4.0
    # Smallest order of a ripple, in periods per turn. Gravity has order one, its products with inertia order two.
    min_order: float = 4.0
    min_rows_per_period: float = 8.0  # the highest order has this many rows per period at the median speed
    order_oversampling: int = 8  # number of orders that are evaluated for each independent one
    # Number of independent neighbouring orders with which a line is compared, half on either side.
    neighbour_count: int = 30


RIPPLE_THRESHOLDS = RippleThresholds()


@dataclass(frozen=True)
class SpectralLine:
    """A spectral line in a motor's residual over its angle."""

    motor: int  # index of the motor
    order: float  # periods per turn
    p_value: float  # probability of such a line anywhere in noise


def find_strongest_line(
    motor: int, angle: np.ndarray, speed: np.ndarray, residual: np.ndarray, rate: float
) -> SpectralLine | None:
    """Return the strongest line of a `residual`, (n,), over an `angle`, (n,), that moves at `speed`, (n,).

    `rate` is that of the rows [Hz]. Returns None if the rows resolve too few orders.
    """
    low, high = float(angle.min()), float(angle.max())
    turns = (high - low) / (2.0 * np.pi)
    if turns <= 0.0 or not np.isfinite(rate):
        return None
    first = max(RIPPLE_THRESHOLDS.min_order, RIPPLE_THRESHOLDS.min_periods / turns)
    last = 2.0 * np.pi * rate / RIPPLE_THRESHOLDS.min_rows_per_period / float(np.median(np.abs(speed)))
    independent = (last - first) * turns
    if independent < RIPPLE_THRESHOLDS.neighbour_count:
        return None
    # Rows are summed in bins of the angle, 16 per period of the highest order; one transform then has all orders.
    bins = int(np.ceil(16.0 * last * turns))
    padded = 1 << int(np.ceil(np.log2(bins * RIPPLE_THRESHOLDS.order_oversampling)))
    at = np.minimum(((angle - low) / (high - low) * bins).astype(int), bins - 1)
    gathered = np.bincount(at, residual - residual.mean(), minlength=bins)
    power = np.abs(np.fft.rfft(gathered, padded)) ** 2
    orders = np.arange(len(power)) * bins / padded / turns
    inside = np.flatnonzero((orders >= first) & (orders <= last))
    beside = _neighbour_mean(power, max(1, round(RIPPLE_THRESHOLDS.neighbour_count / 2 * padded / bins)))
    prominence = power[inside] / np.maximum(beside[inside], 1e-300)
    best = int(inside[np.argmax(prominence)])
    x = float(prominence.max())
    order = _refine_order(angle, residual, float(orders[best]), 1.0 / turns / RIPPLE_THRESHOLDS.order_oversampling)
    return SpectralLine(motor, order, float(-np.expm1(independent * np.log1p(-np.exp(-max(x, 1e-9))))))


def _neighbour_mean(power: np.ndarray, half: int) -> np.ndarray:
    """Return the mean power of each order's neighbours, estimated from medians of exponentially distributed powers."""
    step = max(1, half // 4)
    centres = np.arange(0, len(power), step)
    medians = [np.median(power[max(0, c - half) : c + half + 1]) for c in centres]
    return np.interp(np.arange(len(power)), centres, medians) / np.log(2.0)


def _refine_order(angle: np.ndarray, residual: np.ndarray, order: float, step: float) -> float:
    """Refine a coarse order to the one whose sine and cosine explain most of the residual."""
    def left(x: float) -> float:
        w = np.column_stack([np.sin(x * angle), np.cos(x * angle)])
        pull = w.T @ residual
        return -float(pull @ np.linalg.solve(w.T @ w, pull))

    return minimise_on_interval(left, order - step, order + step, tolerance=1e-4)


def find_lines(at: LinearisedModel, found: TreeSolution, rate: float) -> tuple[SpectralLine, ...]:
    """Return the strongest line of every motor, from rows at `rate` [Hz]."""
    rows, made = at.rows, []
    for k, residual in enumerate(at.residuals(found.values)):
        lines = rows.lines[k]
        line = find_strongest_line(k, rows.turned[lines, k], rows.turning[lines, k], residual, rate)
        if line is not None:
            made.append(line)
    return tuple(made)


def choose_ripples(
    at: LinearisedModel, found: TreeSolution, rate: float
) -> tuple[tuple[Ripple, ...], Sequence[SpectralLine]]:
    """Choose the ripples that a fitted model lacks; return them without amplitudes, and the lines considered."""
    lines = find_lines(at, found, rate)
    model, rows = at.model, at.rows
    load = compute_loads(rows, model, found.values)
    kept: list[Ripple] = []
    best = left_out_losses(sum_normal_equations(at), found.sd)
    for line in sorted(lines, key=lambda x: x.p_value):
        if line.p_value >= RIPPLE_THRESHOLDS.max_line_p_value:
            continue
        tried = replace(model, ripples=(*model.ripples, *kept, Ripple(line.motor, line.order, 0.0, 0.0)))
        equations = sum_normal_equations(linearise_rows(tried, rows, load, model.alpha(found.values)))
        losses = left_out_losses(equations, found.sd)
        if sign_flip_p_value(best - losses) < FAMILY_THRESHOLDS.max_term_p_value:
            kept.append(Ripple(line.motor, line.order, 0.0, 0.0))
            best = losses
    return tuple(kept), lines
