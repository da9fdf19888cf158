r"""Which friction terms each joint needs, as its own recording tells: chosen forwards, judged on segments left out.

From plain friction on, every term that some joint lacks is tried: each segment is predicted by a fit to the others, and
what a term saves, :math:`D_s = \sum_j (e_{js}^2 - e'^2_{js})/\sigma_j^2` of segment s, is compared over segments. Were
the term worthless each D_s might as well have the other sign; a term stays in question while the share of signs that
total no less is below `RARE`. Of these the one that saves most is taken, and the search goes on. A
term whose coefficient would be unphysical is none. Nothing of a segment that judges an estimate takes part: a choice is
made anew within whatever rows are given.

Loads are those of the plain fit to all rows given, and Stribeck speeds a grid: then all terms are columns of one set of
normal equations, kept by segment, and to try one is to add a row to a solved system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..block_test import sign_flip_p_value
from .friction_terms import NUMBERS, RICHER, RICHER_SHARED, TERMS, plain_families
from .tree_regression import (
    NormalEquations,
    Part,
    TreeModel,
    TreeRows,
    fit_rows,
    left_out_losses,
    linearised,
    loads_of,
    normal_equations,
    plain_solution,
    weighed,
)

RARE = 0.157
"""The level at which Akaike's criterion takes one more number. On 17 drawn robots of four joints it errs 2 % less on
segments left out than 5 % does; on ten of them it finds 32 of 53 terms instead of 21, and invents 10 instead of 2."""
STRIBECK_SPEEDS = (0.25, 0.125, 0.0625, 0.03125)
"""Tried, of the largest speed of a joint; above a quarter the whole curve would bend."""
FEWEST_SEGMENTS = 5
"""With fewer, no choice of signs is rare enough to tell anything."""


@dataclass(frozen=True)
class Taken:
    """A term that a joint was given: what it saved of the loss on segments left out [%], and its p value."""

    joint: int
    term: str
    saved: float
    p_value: float
    speed: float = float("nan")


@dataclass(frozen=True)
class FamilyChoice:
    """Terms of each joint, with the speeds of Stribeck terms, and in which order they were `taken`."""

    families: tuple[tuple[str, ...], ...]
    speeds: dict[int, float]
    taken: tuple[Taken, ...]


@dataclass(frozen=True)
class _Candidate:
    joint: int
    term: str
    part: Part


@dataclass(frozen=True)
class _Pool(TreeModel):
    """Plain friction and every candidate's column."""

    candidates: tuple[_Candidate, ...] = ()

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        return (*TreeModel(self.robot, self.base, self.families).parts, *(c.part for c in self.candidates))


def chosen_families(rows: TreeRows, terms: Sequence[str] = RICHER + RICHER_SHARED) -> FamilyChoice:
    """Families of a robot's joints by the `rows` given; `terms` that are tried besides plain friction."""
    robot = rows.robot
    plain = TreeModel(robot, rows.base, plain_families(len(robot.names), robot.shared))
    start, _ = fit_rows(plain, rows)
    pool = _Pool(robot, rows.base, plain.families, candidates=tuple(_candidates(rows, terms)))
    present = np.unique(rows.segment[rows.used.any(axis=1)])
    if len(present) < FEWEST_SEGMENTS or not pool.candidates:
        return FamilyChoice(plain.families, {}, ())
    equations = normal_equations(linearised(pool, rows, loads_of(rows, plain, start.values)))
    equations = equations.of_segments(present)
    active = list(range(len(plain.names)))
    waiting = {len(plain.names) + i: c for i, c in enumerate(pool.candidates)}
    taken, sd = [], start.sd
    while waiting:
        gram, moment, _ = weighed(equations, sd)
        at = np.array(sorted(waiting))
        saved, physical = _savings(gram, moment, active, at, [waiting[i].part for i in at])
        worth = []
        for place, each, fine in zip(at, saved.T, physical, strict=True):
            p = sign_flip_p_value(each)
            if fine and p < RARE:
                worth.append((float(each.sum()), p, int(place)))
        if not worth:
            break
        most, p, place = max(worth)
        chosen = waiting[place]
        loss = left_out_losses(equations.of(np.array(active)), sd).sum()
        taken.append(Taken(chosen.joint, chosen.term, 100.0 * most / loss, p, chosen.part.speed))
        active.append(place)
        waiting = {i: c for i, c in waiting.items() if (c.joint, c.term) != (chosen.joint, chosen.term)}
        sd = _spread(equations, active, sd)
    families = [list(family) for family in plain.families]
    for each in taken:
        families[each.joint].append(each.term)
    speeds = {each.joint: each.speed for each in taken if each.term == "stribeck"}
    return FamilyChoice(tuple(map(tuple, families)), speeds, tuple(taken))


def _candidates(rows: TreeRows, terms: Sequence[str]) -> list[_Candidate]:
    made = []
    for k in range(len(rows.robot.names)):
        for term in terms:
            if term.startswith("motor_"):
                if k in rows.robot.shared:
                    made.append(_Candidate(k, term, Part(k, True, term.removeprefix("motor_"))))
            elif term == "stribeck":
                speed = np.abs(rows.velocity[rows.lines[k], k])
                slow = [x * speed.max() for x in STRIBECK_SPEEDS if x * speed.max() > speed.min()]
                made += [_Candidate(k, term, Part(k, False, term, float(x))) for x in slow]
            else:
                made.append(_Candidate(k, term, Part(k, False, TERMS[term][0])))
    return made


def _savings(
    gram: np.ndarray, moment: np.ndarray, active: list[int], at: np.ndarray, parts: Sequence[Part]
) -> tuple[np.ndarray, np.ndarray]:
    """What each candidate `at` (c,) saves on each segment, (S, c), by fits to the others; which are physical, (c,)."""
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
                    p.number == "viscous_positive" or NUMBERS[p.number].lower <= x <= NUMBERS[p.number].upper
                    for p, x in zip(parts, step, strict=True)
                ]
            )
            continue
        moved = np.vstack([-ways, np.eye(len(at))]) * step
        pull = gram[s][np.ix_(both, a)] @ values - moment[s][both]
        saved[s] = -2.0 * pull @ moved - np.sum(moved * (gram[s][np.ix_(both, both)] @ moved), axis=0)
    return saved, physical


def _spread(equations: NormalEquations, active: list[int], sd: np.ndarray) -> np.ndarray:
    """Of each joint's residual, (m,), with the terms taken so far."""
    a = np.array(active)
    gram, moment, _ = weighed(equations, sd)
    x = plain_solution(gram.sum(axis=0)[np.ix_(a, a)], moment.sum(axis=0)[a])
    whole = equations.of(a).total()
    return np.sqrt(whole.squares(x)[0] / np.maximum(whole.count[0], 1.0))
