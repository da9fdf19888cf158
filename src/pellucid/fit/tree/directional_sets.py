r"""Models dissociated by the directions of motion, as the ABLE paper's eq. 7 counts them, beside one body.

Every joint has a set of parameters, its row of base parameters with an offset and viscous friction, for each
combination of the signs of velocities: its own, and those of the joints that it is coupled to. With p parameters of a
joint, both its own directions among them, n joints have

.. math::
   N = p\sum_{i=0}^{n-1} 2^i = p\,(2^n - 1) \quad\text{(printed)}, \qquad N = n\,p\,2^{n-1} \quad\text{(errata, A15)}

The printed sum couples a joint to those on one side of it, here to those that it carries; the second to all others. A
sample belongs to the set of the signs of its velocities, 0 counting as forwards. A set that no fitted sample belongs to
has no parameters; where a judged motion visits it, the joint's sets of its own directions alone stand in.

A body loses energy along every closed path. Sets know nothing of each other: going around a path the model may give out
more than it takes, and a controller that compensates it then drives the wearer. `energy` counts how often.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion
from .base_parameters import rigid_columns
from .fit_tree import fit_tree
from .friction_terms import PLAIN, plain_families
from .tree_regression import TreeModel, TreeRows, linearised, normal_equations, told, tree_rows

COUPLINGS = ("own", "one side", "all")
"""Whose directions a joint's parameters change with, beside its own: nobody's, those it carries, everybody's."""

FEWEST_ROWS = 2  # for each parameter of a set: fewer are not fitted
CYCLES, STEPS = 200, 240  # closed paths, and samples of each
SEED = 7

Effort = Callable[[TreeMotion], np.ndarray]


@dataclass(frozen=True, eq=False)
class DirectionalModel:
    """Parameters of each joint's row by the signs of velocities: `sets[j]` from a pattern of +1 and -1 of the joints
    `seen[j]`, its own first, to values (r + 2,); `conditions` of their columns."""

    robot: Robot
    chosen: np.ndarray  # (r,) of all numbers of the robot, its base parameters
    coupling: str
    seen: tuple[tuple[int, ...], ...]
    sets: tuple[dict[tuple[int, ...], np.ndarray], ...]
    own: tuple[dict[tuple[int, ...], np.ndarray], ...]
    conditions: tuple[float, ...]
    per_direction: tuple[int, ...]
    """Of each joint: parameters of one set."""
    fitted: int
    """Parameters that the rows tell, of all sets."""

    @property
    def possible(self) -> int:
        """Sets of all joints."""
        return sum(2 ** len(joints) for joints in self.seen)

    @property
    def parameters(self) -> int:
        """That all sets would have."""
        return sum(p * 2 ** len(joints) for p, joints in zip(self.per_direction, self.seen, strict=True))

    @property
    def visited(self) -> int:
        """Sets that the fitted motions visit often enough."""
        return sum(map(len, self.sets))

    @property
    def missing(self) -> tuple[str, ...]:
        """Sets that they do not: "elbow: elbow +, shoulder -"."""
        said = []
        for joints, known in zip(self.seen, self.sets, strict=True):
            for code in range(2 ** len(joints)):
                signs = tuple(1 if code >> i & 1 else -1 for i in range(len(joints)))
                if signs not in known:
                    each = zip(joints, signs, strict=True)
                    ways = ", ".join(f"{self.robot.names[k]} {'+' if s > 0 else '-'}" for k, s in each)
                    said.append(f"{self.robot.names[joints[0]]}: {ways}")
        return tuple(said)

    def effort(self, motion: TreeMotion) -> np.ndarray:
        """Predicted at the joints, shape (n, m) [N m; N]."""
        columns = _columns(self.robot, self.chosen, motion)
        made = np.zeros_like(motion.velocity)
        for j, joints in enumerate(self.seen):
            for signs, mine in _patterns(motion.velocity[:, joints]):
                values = self.sets[j].get(signs)
                values = self.own[j].get(signs[:1]) if values is None else values
                if values is not None:
                    made[mine, j] = columns[mine, j] @ values
        return made


def _columns(robot: Robot, chosen: np.ndarray, motion: TreeMotion) -> np.ndarray:
    """Of every joint's row, (n, m, r + 2): base parameters, its velocity, 1."""
    v = motion.velocity
    rigid = rigid_columns(robot, motion.position, v, motion.acceleration)[:, :, chosen]
    return np.concatenate([rigid, v[:, :, None], np.ones((*v.shape, 1))], axis=2)


def _patterns(velocity: np.ndarray) -> list[tuple[tuple[int, ...], np.ndarray]]:
    """Signs that occur and the rows, (k,), in which they do; `velocity` (n, joints)."""
    code = (velocity >= 0.0) @ (1 << np.arange(velocity.shape[1]))
    found = []
    for c in np.unique(code):
        signs = tuple(1 if c >> i & 1 else -1 for i in range(velocity.shape[1]))
        found.append((signs, np.flatnonzero(code == c)))
    return found


def _coupled(robot: Robot, j: int, coupling: str) -> tuple[int, ...]:
    """Whose directions joint j's parameters change with, its own first."""
    if coupling == "own":
        return (j,)
    if coupling == "all":
        return (j, *(k for k in range(len(robot.names)) if k != j))
    carried, moving = {robot.tree.moving[j].child}, []
    for joint in robot.tree.order:
        if joint.parent in carried:
            carried.add(joint.child)
            if joint.kind != "fixed":
                moving.append(robot.names.index(joint.name))
    return (j, *moving)


def fit_directional(rows: TreeRows, coupling: str = "all") -> DirectionalModel:
    """Least squares of every set of every joint; `coupling` one of `COUPLINGS`."""
    robot = rows.robot
    columns = np.concatenate([rows.rigid, rows.velocity[:, :, None], np.ones((*rows.velocity.shape, 1))], axis=2)
    seen = tuple(_coupled(robot, j, coupling) for j in range(len(robot.names)))
    sets, own, conditions, sizes, fitted = [], [], [], [], 0
    for j, joints in enumerate(seen):
        lines = rows.lines[j]
        x, y, v = columns[lines, j], rows.effort[lines, j], rows.velocity[lines]
        # What is one column for this joint whatever moves is one parameter, in every set.
        kept = np.flatnonzero(told(x.T @ x))
        sizes.append(len(kept))
        mine = {}
        for signs, at in _patterns(v[:, joints]):
            if len(at) >= FEWEST_ROWS * len(kept):
                mine[signs], condition, rank = _solved(x[at], y[at], kept)
                conditions.append(condition)
                fitted += rank
        sets.append(mine)
        alone = {}
        for signs, at in _patterns(v[:, [j]]):
            alone[signs] = _solved(x[at], y[at], kept)[0]
        own.append(alone)
    return DirectionalModel(
        robot, rows.base.chosen, coupling, seen, tuple(sets), tuple(own), tuple(conditions), tuple(sizes), fitted
    )


def _solved(x: np.ndarray, y: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, float, int]:
    """Values (r + 2,), condition of the columns that are `kept` at unit length, and how many are told."""
    gram = x[:, kept].T @ x[:, kept]
    size = np.sqrt(np.diag(gram))
    known = told(gram)
    spread = np.linalg.eigvalsh(gram / np.outer(np.where(size > 0, size, 1.0), np.where(size > 0, size, 1.0)))
    condition = float(np.sqrt(spread[-1] / spread[0])) if spread[0] > 1e-14 * spread[-1] else float("inf")
    values, at = np.zeros(x.shape[1]), kept[known]
    values[at] = np.linalg.lstsq(x[:, at] / size[known], y, rcond=None)[0] / size[known]
    return values, condition, int(known.sum())


@dataclass(frozen=True)
class DirectionalRow:
    """One model of n joints: `parameters` that it has and how many of them motions tell, sets and how many are
    visited, `error` (m,) of a motion that it was not fitted to [% of each joint's effort], condition, and energy."""

    joints: int
    model: str
    parameters: int
    fitted: int
    sets: int
    visited: int
    error: tuple[float, ...]
    condition: float  # Median over sets
    worst_condition: float
    creates: float
    """Share of closed paths along which the model gives energy out [%]."""
    least: float
    """Energy that it takes along the worst path, over what one body loses there."""
    missing: tuple[str, ...] = field(default=(), repr=False)

    @property
    def mean(self) -> float:
        """Of the errors [%]."""
        return float(np.mean(self.error))


def compare_directional(
    robot: Robot,
    fitted: Sequence[TreeMotion],
    judged: Sequence[TreeMotion],
    *,
    width: float = 0.0,
    families: Sequence[Sequence[str]] | None = None,
) -> tuple[DirectionalRow, ...]:
    """One body with load friction (or other `families`), one body with plain friction, and directional sets by own
    directions, as printed and as the errata have it, all fitted to the same rows and judged on the same others."""
    rows = tree_rows(robot, fitted, width=width)
    n = len(robot.names)
    load = tuple((*PLAIN, "load") for _ in range(n)) if families is None else families
    body = fit_tree(robot, fitted, load, name="load", width=width)
    plain = fit_tree(robot, fitted, None, name="plain", width=width)
    paths = closed_paths(rows)
    lost = _taken(body.effort, paths)
    made = [
        _row(name, robot, judged, paths, lost, each.effort, (len(each.array),) * 2, (1, 1), (_condition(rows),))
        for name, each in (("one body, load friction", body), ("one body, plain friction", plain))
    ]
    for coupling in COUPLINGS if n > 1 else COUPLINGS[:1]:
        sets = fit_directional(rows, coupling)
        made.append(
            _row(
                f"sets, {coupling}",
                robot,
                judged,
                paths,
                lost,
                sets.effort,
                (sets.parameters, sets.fitted),
                (sets.possible, sets.visited),
                sets.conditions,
                sets.missing,
            )
        )
    return tuple(made)


def _row(
    name: str,
    robot: Robot,
    judged: Sequence[TreeMotion],
    paths: Sequence[TreeMotion],
    lost: np.ndarray,
    effort: Effort,
    parameters: tuple[int, int],
    sets: tuple[int, int],
    conditions: Sequence[float],
    missing: tuple[str, ...] = (),
) -> DirectionalRow:
    """What is to be said of one model's `effort`; one body loses `lost` (paths,) along `paths`."""
    taken = _taken(effort, paths)
    return DirectionalRow(
        len(robot.names),
        name,
        *parameters,
        *sets,
        _errors(effort, judged),
        float(np.median(conditions)),
        float(np.max(conditions)),
        100.0 * float(np.mean(taken < 0.0)),
        float(np.min(taken / lost)),
        missing,
    )


def _errors(effort: Effort, judged: Sequence[TreeMotion]) -> tuple[float, ...]:
    """RMS error of each joint over its RMS effort, where it moves [%]."""
    apart = np.concatenate([np.where(x.moving, x.effort - effort(x), 0.0) for x in judged])
    whole = np.concatenate([np.where(x.moving, x.effort, 0.0) for x in judged])
    return tuple((100.0 * np.linalg.norm(apart, axis=0) / np.linalg.norm(whole, axis=0)).tolist())


def _condition(rows: TreeRows) -> float:
    """Of one body's columns at unit length, joints weighing alike."""
    model = TreeModel(rows.robot, rows.base, plain_families(len(rows.robot.names), rows.robot.shared))
    grams = normal_equations(linearised(model, rows), apart=False).total().gram[0]
    gram = np.tensordot(1.0 / np.maximum(rows.size, 1e-12) ** 2, grams, 1)
    known = told(gram)
    size = np.sqrt(np.diag(gram)[known])
    spread = np.linalg.eigvalsh(gram[np.ix_(known, known)] / np.outer(size, size))
    return float(np.sqrt(spread[-1] / spread[0]))


def closed_paths(rows: TreeRows, count: int = CYCLES, seed: int = SEED) -> tuple[TreeMotion, ...]:
    """Ellipses through all joints within what the rows cover of places and speeds: all joints at one period."""
    rng, n = np.random.default_rng(seed), rows.velocity.shape[1]
    some = rows.used.any(axis=1)
    low, high = np.quantile(rows.position[some], [0.05, 0.95], axis=0)
    fast = np.maximum(np.quantile(np.abs(rows.velocity[some]), 0.9, axis=0), 1e-9)
    phase = 2.0 * np.pi * np.arange(STEPS) / STEPS
    made = []
    for _ in range(count):
        size = 0.5 * (high - low) * rng.uniform(0.1, 1.0, n)
        centre = rng.uniform(low + size, high - size)
        way = phase[:, None] + rng.uniform(0.0, 2.0 * np.pi, n)
        omega = float(np.min(fast / size))
        t = phase / omega
        q, v = centre + size * np.sin(way), omega * size * np.cos(way)
        a = -(omega**2) * size * np.sin(way)
        nothing, every = np.zeros_like(q), np.ones(q.shape, bool)
        made.append(TreeMotion("path", "validate", t, q, v, a, nothing, every, np.zeros(STEPS, int)))
    return tuple(made)


def _taken(effort: Effort, paths: Sequence[TreeMotion]) -> np.ndarray:
    """Energy that each closed path takes by a model's effort, (paths,) [J]; below 0 it gives some out."""
    return np.array([np.sum(effort(x) * x.velocity) * (x.time[1] - x.time[0]) for x in paths])
