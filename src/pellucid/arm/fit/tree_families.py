r"""Choose the friction terms of each joint by forward selection, tested on left-out segments.

The search starts from plain friction and tries every further term of every joint. Each segment is predicted by a fit to
the others. A term reduces the loss of segment s by :math:`D_s = \sum_j (e_{js}^2 - e'^2_{js})/\sigma_j^2`. If the term
were useless, each D_s could as well have the other sign. A term qualifies if the share of all choices of signs with no
smaller total is below `MAX_TERM_P_VALUE`, if its coefficient is physical, and if it saves at least the share
`min_improvement` of the error of its joint. The qualifying term with the largest reduction is added, and the search
continues. Only the given rows take part, so cross-validation can repeat the choice.

The loads are those of the plain fit to all rows, and Stribeck speeds come from a grid. All terms are then columns of
one set of normal equations, kept by segment, and trying a term means adding a row to a solved system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..._errors import IdentificationError
from ...models.friction_terms import DIRECTIONAL_FEATURE, STRIBECK_FRICTION
from ...numerics.block_test import MIN_IMPROVEMENT, sign_flip_p_value
from ...numerics.regression import MAX_REWEIGHTINGS, robust_weights
from .friction_terms import FRICTION_COEFFICIENTS, FURTHER_MOTOR_TERMS, FURTHER_TERMS, TERM_COEFFICIENTS, plain_families
from .output_error import solve_output_error
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
    linearise_rows,
    plain_solution,
    sum_normal_equations,
    weight_joints,
)

MAX_TERM_P_VALUE = 0.157
"""A term is added only if its p value is below this level, at which Akaike's criterion adds one parameter. On 17
simulated robots of four joints, with no least improvement, the error on left-out segments is 2 % smaller than with a
level of 5 %. On ten of them it finds 32 of 53 terms instead of 21, and adds 10 false ones instead of 2."""

STRIBECK_SPEED_SHARES = (0.25, 0.125, 0.0625, 0.03125)
"""Stribeck velocities that are tried, as shares of a joint's largest speed. With larger ones the term would change the
whole friction curve."""

MIN_SEGMENTS = 5
"""Terms are chosen only with at least this many segments. With fewer, no choice of signs is rare enough."""


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
) -> FamilyChoice:
    """Choose the friction families of a robot's joints within `rows`; `terms` are tried in addition to plain ones.

    A term must save at least the share `min_improvement` of the error with which left-out segments of its joint are
    predicted.
    """
    robot = rows.robot
    plain = TreeModel(robot, rows.base, plain_families(len(robot.names), robot.shared))
    start, _ = fit_rows(plain, rows)
    pool = _CandidateModel(robot, rows.base, plain.families, candidates=tuple(_candidates(rows, terms)))
    present = np.unique(rows.segment[rows.used.any(axis=1)])
    if len(present) < MIN_SEGMENTS or not pool.candidates:
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
            if fine and p < MAX_TERM_P_VALUE and each.sum() >= least[waiting[int(place)].joint]:
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
                slow = [x * speed.max() for x in STRIBECK_SPEED_SHARES if x * speed.max() > speed.min()]
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


ESTIMATION_METHODS = ("ordinary", "weighted", "robust", "instrumental", "output_error")
"""Estimators by name, the plainest first."""

INSTRUMENT_LAG_S = 0.02
"""Lag of the instruments [s], twice the memory of a 50 Hz low-pass."""

EFFORT_CHANGE_TOLERANCE = 1e-4
"""Iterations stop when a step changes every joint's effort by less than this share of its RMS effort."""


def solve_by_method(method: str, model: TreeModel, rows: TreeRows, rate: float) -> tuple[TreeSolution, LinearisedModel]:
    """Solve for a model's parameters by one of `ESTIMATION_METHODS`; `rate` is that of the rows [Hz]."""
    if method == "ordinary":
        return fit_rows(model, rows, rounds=0)
    if method == "weighted":
        return fit_rows(model, rows)
    if method == "robust":
        return solve_robust(model, rows)
    if method == "instrumental":
        return solve_instrumental(model, rows, max(1, round(INSTRUMENT_LAG_S * rate)))
    if method == "output_error":
        return solve_output_error(model, rows, rate)
    raise IdentificationError(f"found method {method!r}, expected one of {', '.join(ESTIMATION_METHODS)}")


def solve_robust(model: TreeModel, rows: TreeRows) -> tuple[TreeSolution, LinearisedModel]:
    """Solve weighted least squares with Huber's weights within each joint, until the efforts settle."""
    found, at = fit_rows(model, rows)
    for iteration in range(MAX_REWEIGHTINGS):
        weights = [robust_weights(r) ** 2 for r in at.residuals(found.values)]
        before, (found, at) = found, fit_rows(model, rows, weights=weights, start=found)
        if _largest_effort_change(at, found.values - before.values) < EFFORT_CHANGE_TOLERANCE:
            return replace(found, iterations=iteration + 1, converged=True), at
    return replace(found, iterations=MAX_REWEIGHTINGS, converged=False), at


def solve_instrumental(model: TreeModel, rows: TreeRows, lag: int) -> tuple[TreeSolution, LinearisedModel]:
    """Solve with instruments from the columns `lag` rows before and after.

    Rows within `lag` rows of either end of a recording do not count.
    """
    found, _ = fit_rows(model, rows)
    n = len(rows.stretch)
    early, late = np.arange(n) - lag, np.arange(n) + lag
    whole = (early >= 0) & (late < n)
    whole[whole] = rows.stretch[early[whole]] == rows.stretch[late[whole]]
    kept = replace(rows, used=rows.used & whole[:, None])
    if not kept.used.any(axis=0).all():
        raise IdentificationError(
            f"instruments {lag} rows apart leave a joint without rows: expected longer recordings"
        )
    values, converged, steps = found.values.copy(), False, 0
    while not converged and steps < 10:
        steps += 1
        at = linearise_rows(model, kept, compute_loads(rows, model, values), model.alpha(values))
        z = _lagged_mean_columns(model, rows, values, kept, lag)
        p = len(values)
        gram, pull = np.zeros((p, p)), np.zeros(p)
        for j, (place, x, r) in enumerate(zip(at.places, at.columns, at.residuals(values), strict=True)):
            gram[np.ix_(place, place)] += z[j].T @ x / found.sd[j] ** 2
            pull[place] += z[j].T @ r / found.sd[j] ** 2
        free = np.flatnonzero(found.seen & ~found.held)
        size = np.sqrt(np.abs(np.diag(gram)))[free]
        unit = gram[np.ix_(free, free)] / np.outer(size, size)
        step = np.zeros(p)
        step[free] = np.linalg.solve(unit, pull[free] / size) / size
        lower, upper = model.bounds
        after = np.clip(values + step, lower, upper)
        converged, values = _largest_effort_change(at, after - values) < EFFORT_CHANGE_TOLERANCE, after
    at = linearise_rows(model, kept, compute_loads(rows, model, values), model.alpha(values))
    sd = np.array([np.sqrt(np.mean(r**2)) for r in at.residuals(values)])
    return replace(found, values=values, sd=sd, iterations=steps, converged=converged), at


def _lagged_mean_columns(
    model: TreeModel, rows: TreeRows, values: np.ndarray, kept: TreeRows, lag: int
) -> tuple[np.ndarray, ...]:
    """Return the mean of each joint's columns `lag` rows before and after the rows `kept`, (n_j, c)."""
    sides = []
    for by in (-lag, lag):
        used = np.roll(kept.used, by, axis=0)
        there = replace(rows, used=used)
        sides.append(linearise_rows(model, there, compute_loads(rows, model, values), model.alpha(values)).columns)
    return tuple(0.5 * (a + b) for a, b in zip(*sides, strict=True))


def _largest_effort_change(at: LinearisedModel, step: np.ndarray) -> float:
    """Return the largest RMS effort that a step makes at any joint, divided by that joint's RMS effort."""
    each = zip(at.places, at.columns, at.rows.size, strict=True)
    return max(float(np.sqrt(np.mean((x @ step[place]) ** 2)) / size) for place, x, size in each)
