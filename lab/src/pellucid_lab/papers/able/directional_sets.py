r"""Direction-dependent models, as counted by the ABLE paper's eq. 7, compared with one rigid-body model.

Every joint has one set of parameters for each combination of the signs of velocities: its own, and those of the joints
to which it is coupled. A set consists of the joint's row of base parameters, an offset and viscous friction. With p
parameters of a joint, both its own directions among them, n joints have

.. math::
   N = p\sum_{i=0}^{n-1} 2^i = p\,(2^n - 1) \quad\text{(printed)}, \qquad N = n\,p\,2^{n-1} \quad\text{(errata, A15)}

The printed sum couples a joint to those on one side of it, here to those that it carries. The second couples it to all
others. A sample belongs to the set of the signs of its velocities; 0 counts as forwards. A set without fitted samples
has no parameters. If a test motion visits it, the joint's sets by its own direction alone replace it.

A physical joint loses energy along every closed path. Independent sets need not: along a closed path such a model may
create energy, and a controller that compensates it then drives the wearer. `DirectionalRow.creates` counts how often.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from pellucid.arm.fit.fit_tree import fit_tree
from pellucid.arm.fit.friction_terms import PLAIN_TERMS, plain_families
from pellucid.arm.fit.tree_estimate import rigid_columns
from pellucid.arm.fit.tree_regression import (
    TreeModel,
    TreeRows,
    collect_rows,
    determined_parameters,
    linearise_rows,
    sum_normal_equations,
)
from pellucid.arm.tree_motion import TreeMotion
from pellucid.models.robot import Robot

DIRECTION_COUPLINGS = ("own", "one side", "all")
"""Couplings of a joint's parameters to directions: its own alone, also those of joints it carries, or of all joints."""

MIN_ROWS_PER_PARAMETER = 2
"""Smallest number of rows per parameter for which a set is fitted."""

CLOSED_PATH_COUNT = 200
"""Number of closed paths along which energy is measured."""

SAMPLES_PER_PATH = 240
"""Number of samples in each closed path."""

PATH_SEED = 7
"""Random seed of the closed paths."""

Effort = Callable[[TreeMotion], np.ndarray]
"""A function from a motion to the effort at the joints, (n, m)."""


@dataclass(frozen=True, eq=False)
class DirectionalModel:
    """Parameters of each joint's row by the signs of velocities."""

    robot: Robot
    chosen: np.ndarray  # indices of the base parameters among all inertial parameters, (r,)
    coupling: str  # one of `DIRECTION_COUPLINGS`
    seen: tuple[tuple[int, ...], ...]  # for each joint, the joints whose directions select its set, its own first
    sets: tuple[dict[tuple[int, ...], np.ndarray], ...]  # for each joint, values (r + 2,) by the signs of these joints
    own: tuple[dict[tuple[int, ...], np.ndarray], ...]  # the same by the sign of its own velocity alone
    conditions: tuple[float, ...]  # condition number of each fitted set
    per_direction: tuple[int, ...]  # number of parameters of one set of each joint
    fitted: int  # number of parameters in all sets that the rows determine

    @property
    def possible(self) -> int:
        """Number of sets of all joints."""
        return sum(2 ** len(joints) for joints in self.seen)

    @property
    def parameters(self) -> int:
        """Number of parameters in all sets, visited or not."""
        return sum(p * 2 ** len(joints) for p, joints in zip(self.per_direction, self.seen, strict=True))

    @property
    def visited(self) -> int:
        """Number of sets that the fitted motions visit often enough."""
        return sum(map(len, self.sets))

    @property
    def missing(self) -> tuple[str, ...]:
        """Sets that the fitted motions do not visit often enough: "elbow: elbow +, shoulder -"."""
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
        """Predict the effort at the joints, shape (n, m) [N m; N]."""
        columns = _row_columns(self.robot, self.chosen, motion)
        made = np.zeros_like(motion.velocity)
        for j, joints in enumerate(self.seen):
            for signs, mine in _sign_patterns(motion.velocity[:, joints]):
                values = self.sets[j].get(signs)
                values = self.own[j].get(signs[:1]) if values is None else values
                if values is not None:
                    made[mine, j] = columns[mine, j] @ values
        return made


def _row_columns(robot: Robot, chosen: np.ndarray, motion: TreeMotion) -> np.ndarray:
    """Return the columns of every joint's row, (n, m, r + 2): base parameters, its velocity, and 1."""
    v = motion.velocity
    rigid = rigid_columns(robot, motion.position, v, motion.acceleration)[:, :, chosen]
    return np.concatenate([rigid, v[:, :, None], np.ones((*v.shape, 1))], axis=2)


def _sign_patterns(velocity: np.ndarray) -> list[tuple[tuple[int, ...], np.ndarray]]:
    """Return the sign patterns of `velocity`, (n, joints), that occur, each with the indices of its rows, (k,)."""
    code = (velocity >= 0.0) @ (1 << np.arange(velocity.shape[1]))
    found = []
    for c in np.unique(code):
        signs = tuple(1 if c >> i & 1 else -1 for i in range(velocity.shape[1]))
        found.append((signs, np.flatnonzero(code == c)))
    return found


def _coupled_joints(robot: Robot, j: int, coupling: str) -> tuple[int, ...]:
    """Return the joints whose directions select the parameters of joint j, itself first."""
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
    """Fit every set of every joint by least squares; `coupling` is one of `DIRECTION_COUPLINGS`."""
    robot = rows.robot
    columns = np.concatenate([rows.rigid, rows.velocity[:, :, None], np.ones((*rows.velocity.shape, 1))], axis=2)
    seen = tuple(_coupled_joints(robot, j, coupling) for j in range(len(robot.names)))
    sets, own, conditions, sizes, fitted = [], [], [], [], 0
    for j, joints in enumerate(seen):
        lines = rows.lines[j]
        x, y, v = columns[lines, j], rows.effort[lines, j], rows.velocity[lines]
        # Columns that are dependent for this joint in all motions are one parameter in every set.
        kept = np.flatnonzero(determined_parameters(x.T @ x))
        sizes.append(len(kept))
        mine = {}
        for signs, at in _sign_patterns(v[:, joints]):
            if len(at) >= MIN_ROWS_PER_PARAMETER * len(kept):
                mine[signs], condition, rank = _solve_set(x[at], y[at], kept)
                conditions.append(condition)
                fitted += rank
        sets.append(mine)
        alone = {}
        for signs, at in _sign_patterns(v[:, [j]]):
            alone[signs] = _solve_set(x[at], y[at], kept)[0]
        own.append(alone)
    return DirectionalModel(
        robot, rows.base.chosen, coupling, seen, tuple(sets), tuple(own), tuple(conditions), tuple(sizes), fitted
    )


def _solve_set(x: np.ndarray, y: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, float, int]:
    """Return values, (r + 2,), the condition number of the scaled columns `kept`, and the number determined."""
    gram = x[:, kept].T @ x[:, kept]
    size = np.sqrt(np.diag(gram))
    known = determined_parameters(gram)
    spread = np.linalg.eigvalsh(gram / np.outer(np.where(size > 0, size, 1.0), np.where(size > 0, size, 1.0)))
    condition = float(np.sqrt(spread[-1] / spread[0])) if spread[0] > 1e-14 * spread[-1] else float("inf")
    values, at = np.zeros(x.shape[1]), kept[known]
    values[at] = np.linalg.lstsq(x[:, at] / size[known], y, rcond=None)[0] / size[known]
    return values, condition, int(known.sum())


@dataclass(frozen=True)
class DirectionalRow:
    """One model in the comparison of direction-dependent models."""

    joints: int  # number of joints, m
    model: str  # name of the model
    parameters: int  # number of parameters in all sets
    fitted: int  # number of parameters that the motions determine
    sets: int  # number of sets
    visited: int  # number of sets with enough fitted samples
    error: tuple[float, ...]  # error on test motions, (m,) [% of each joint's RMS effort]
    condition: float  # median condition number over sets
    worst_condition: float  # largest condition number of any set
    creates: float  # share of closed paths along which the model creates energy [%]
    least: float  # energy lost along the worst path, divided by the loss of the rigid-body model there
    missing: tuple[str, ...] = field(default=(), repr=False)  # sets without enough fitted samples

    @property
    def mean(self) -> float:
        """Mean error over joints [%]."""
        return float(np.mean(self.error))


def compare_directional(
    robot: Robot,
    fitted: Sequence[TreeMotion],
    judged: Sequence[TreeMotion],
) -> tuple[DirectionalRow, ...]:
    """Compare rigid-body models with direction-dependent ones, fitted to the same rows and tested on the same others.

    The first has load friction, the second plain friction. The others have sets by each joint's
    own direction, as printed in the paper, and as in its errata.
    """
    rows = collect_rows(robot, fitted)
    n = len(robot.names)
    body = fit_tree(robot, fitted, tuple((*PLAIN_TERMS, "load") for _ in range(n)), name="load")
    plain = fit_tree(robot, fitted, None, name="plain")
    paths = draw_closed_paths(rows)
    lost = _dissipated_energy(body.effort, paths)
    made = [
        _evaluate(
            name, robot, judged, paths, lost, each.effort, (len(each.array),) * 2, (1, 1), (_condition_number(rows),)
        )
        for name, each in (("one body, load friction", body), ("one body, plain friction", plain))
    ]
    for coupling in DIRECTION_COUPLINGS if n > 1 else DIRECTION_COUPLINGS[:1]:
        sets = fit_directional(rows, coupling)
        made.append(
            _evaluate(
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


def _evaluate(
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
    """Evaluate one model's `effort`; the rigid-body model loses energy `lost`, (paths,) [J], along `paths`."""
    taken = _dissipated_energy(effort, paths)
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
    """Return the RMS error of each joint divided by its RMS effort, over the samples in which it moves [%]."""
    apart = np.concatenate([np.where(x.moving, x.effort - effort(x), 0.0) for x in judged])
    whole = np.concatenate([np.where(x.moving, x.effort, 0.0) for x in judged])
    return tuple((100.0 * np.linalg.norm(apart, axis=0) / np.linalg.norm(whole, axis=0)).tolist())


def _condition_number(rows: TreeRows) -> float:
    """Return the condition number of the rigid-body model's scaled columns, with equal weights of joints."""
    model = TreeModel(rows.robot, rows.base, plain_families(len(rows.robot.names), rows.robot.shared))
    grams = sum_normal_equations(linearise_rows(model, rows), apart=False).total().gram[0]
    gram = np.tensordot(1.0 / np.maximum(rows.size, 1e-12) ** 2, grams, 1)
    known = determined_parameters(gram)
    size = np.sqrt(np.diag(gram)[known])
    spread = np.linalg.eigvalsh(gram[np.ix_(known, known)] / np.outer(size, size))
    return float(np.sqrt(spread[-1] / spread[0]))


def draw_closed_paths(rows: TreeRows, count: int = CLOSED_PATH_COUNT, seed: int = PATH_SEED) -> tuple[TreeMotion, ...]:
    """Return random ellipses within the positions and speeds of the rows, with one period for all joints."""
    rng, n = np.random.default_rng(seed), rows.velocity.shape[1]
    some = rows.used.any(axis=1)
    low, high = np.quantile(rows.position[some], [0.05, 0.95], axis=0)
    fast = np.maximum(np.quantile(np.abs(rows.velocity[some]), 0.9, axis=0), 1e-9)
    phase = 2.0 * np.pi * np.arange(SAMPLES_PER_PATH) / SAMPLES_PER_PATH
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
        made.append(TreeMotion("path", "validate", t, q, v, a, nothing, every, np.zeros(SAMPLES_PER_PATH, int)))
    return tuple(made)


def _dissipated_energy(effort: Effort, paths: Sequence[TreeMotion]) -> np.ndarray:
    """Return the energy that a model's effort dissipates along each closed path, (paths,) [J]; negative if created."""
    return np.array([np.sum(effort(x) * x.velocity) * (x.time[1] - x.time[0]) for x in paths])
