r"""Choose the friction terms of each joint by forward selection, tested on left-out segments.

The search starts from plain friction and tries every further term of every joint. Each segment is predicted by a fit to
the others. A term reduces the loss of segment s by :math:`D_s = \sum_j (e_{js}^2 - e'^2_{js})/\sigma_j^2`. If the term
were useless, each D_s could as well have the other sign. A term qualifies if the share of all choices of signs with no
smaller total is below `max_term_p_value`, if its coefficient is physical, and if it saves at least the share
`min_improvement` of the error of its joint. The qualifying term with the largest reduction is added, and the search
continues. Only the given rows take part, so cross-validation can repeat the choice.

The loads are those of the plain fit to all rows, and Stribeck speeds come from a grid. All terms are then columns of
one set of normal equations, kept by segment, and trying a term means adding a row to a solved system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models.friction_terms import DIRECTIONAL_FEATURE, STRIBECK_FRICTION
from ...numerics.block_test import MIN_IMPROVEMENT, sign_flip_p_value
from .friction_terms import FRICTION_COEFFICIENTS, FURTHER_MOTOR_TERMS, FURTHER_TERMS, TERM_COEFFICIENTS, plain_families
from .tree_regression import (
    FrictionPart,
    NormalEquations,
    TreeModel,
    TreeRows,
    compute_loads,
    fit_rows,
    left_out_joint_losses,
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
