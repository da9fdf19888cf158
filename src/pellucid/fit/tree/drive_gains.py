r"""Gains of drives, effort for each ampere or volt: from a known payload, or from what a controller says of its torque.

**From a payload.** With y what robot and load need at the motors, friction with it, and i what a drive reports,

.. math::
   i_j = \gamma_j\,(Y x + Y_l\varphi + m\,Y_m)_j + e_j,\qquad k_j = 1/\gamma_j

where the load's mass m is known and its other nine numbers are not. Noise is in i: with i among the regressors, and
residuals in N m, small gains make small residuals, and gains come out low. Here residuals are in ampere, each drive
weighing as its own residual, and the problem, linear in all but gamma, is solved for both together by Gauss and Newton.

**From a controller.** A controller that reports the torque of its own rigid-body model beside the current it asks for
says its gain: the current regressed on torque, v, sign(v) and 1, friction being what the torque leaves out. It needs no
load, and is as right as the controller's own model.

Intervals are the jackknife's over segments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.robot import Robot
from ...signals.tree_motion import TreeMotion
from ..parameter import Parameter
from ..uncertainty import student_to_normal_ratio
from .carried_load import LoadedRows, loaded_rows
from .friction_terms import direction, plain_families
from .tree_regression import TreeModel, fit_rows, linearised, loads_of, told

STEPS = 30  # of Gauss and Newton
SETTLED = 1e-9  # relative change of a gain
WEIGHED = 6  # steps after which weights stay
PARTS_OF_LOAD = 3  # rounds of what load terms take


def gains_from_desired(robot: Robot, motions: Sequence[TreeMotion], *, width: float = 0.0) -> tuple[Parameter, ...]:
    """Of each motor, from the controller's `desired` effort and `desired_drive`; `width` of the smooth sign of friction
    [rad/s; m/s]."""
    lacking = [x.recording for x in motions if x.desired is None or x.desired_drive is None]
    if lacking or not motions:
        where = lacking[0] if lacking else "no recording"
        raise IdentificationError(
            f"{where}: found no desired torque and desired current of every joint, expected both; name their channels, "
            "or record the same motion with a known payload and without"
        )
    turns = np.asarray(robot.turns)
    back = np.linalg.inv(turns)
    sums = [[] for _ in robot.names]
    for motion in motions:
        wanted, speed = motion.desired @ back, motion.velocity @ turns.T
        for i in range(len(robot.names)):
            v = speed[:, i]
            z = np.column_stack([wanted[:, i], v, direction(v, width), np.ones_like(v), motion.desired_drive[:, i]])
            for s in range(int(motion.segment.max(initial=-1)) + 1):
                mine = z[motion.moving[:, i] & (motion.segment == s)]
                sums[i].append(mine.T @ mine)
    found = []
    for i, each in enumerate(sums):
        whole = np.sum(each, axis=0)
        if len(each) < 2 or not _slope(whole) > 0.0:
            raise IdentificationError(
                f"motor of {robot.names[i]}: its desired current does not rise with its desired torque; check the "
                "signs of both channels, and that the joint moves"
            )
        left = 1.0 / np.array([_slope(whole - part) for part in each])
        found.append(_gain(robot, motions[0], i, 1.0 / _slope(whole), _jackknife(left)))
    return tuple(found)


def _slope(gram: np.ndarray) -> float:
    """Of the last column on the first, the others beside it; 0 where it cannot be told."""
    size = np.sqrt(np.maximum(np.diag(gram), 0.0))
    kept = np.flatnonzero(size[:-1] > 0.0)
    if not size[0] > 0.0:
        return 0.0
    unit = gram[np.ix_(kept, kept)] / np.outer(size[kept], size[kept])
    if np.linalg.cond(unit) > 1e12:
        return 0.0
    return float(np.linalg.solve(unit, gram[kept, -1] / size[kept])[0] / size[0])


def _jackknife(left: np.ndarray) -> float:
    """Standard error of what came out as `left`, (s,), without each segment."""
    n = len(left)
    error = np.sqrt((n - 1) / n * np.sum((left - left.mean()) ** 2))
    return float(error * (student_to_normal_ratio(n - 1.0) if n > 2 else 6.5))


def _gain(robot: Robot, motion: TreeMotion, i: int, value: float, error: float) -> Parameter:
    unit = robot.units[i][1]
    drive = motion.drive_units[i] if motion.drive_units else "A"
    shown = value > 1.959964 * error
    return Parameter(f"{robot.names[i]}.gain", f"{unit}/{drive}", float(value), error, identifiable=bool(shown))


@dataclass(frozen=True, eq=False)
class _DriveSums:
    """Of each segment and motor, Z'Z with Z = [columns of all parameters, their known part, what the drive reports]:
    `gram` (S, m, p + 2, p + 2), from `count` (S, m) rows. The known part counts against the columns."""

    gram: np.ndarray
    count: np.ndarray

    def without(self, segment: int) -> _DriveSums:
        """All rows but those of a segment."""
        return _DriveSums(
            self.gram.sum(axis=0, keepdims=True) - self.gram[segment : segment + 1],
            self.count.sum(axis=0, keepdims=True) - self.count[segment : segment + 1],
        )

    def solved(self, gamma: np.ndarray, x: np.ndarray, fixed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """1 / gains (m,) and parameters (p,), from a start; those `fixed` (p,) bool stay."""
        gram, count = self.gram.sum(axis=0), self.count.sum(axis=0)
        m, p = len(gamma), len(x)
        free = np.flatnonzero(~fixed)
        weight = None
        for step in range(STEPS):
            model = np.append(x, -1.0)  # columns x less the known part
            made = gram[:, :-1, :-1] @ model  # (m, p + 1): Z'a
            power = made @ model  # a'a
            met = gram[:, :-1, -1]  # Z'i
            if step < WEIGHED:
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
            seen = told(inner)
            size = np.sqrt(np.diag(inner)[seen])
            move = np.zeros(len(kept))
            unit = inner[np.ix_(seen, seen)] / np.outer(size, size)
            move[seen] = np.linalg.solve(unit, slope[kept][seen] / size) / size
            change = move[len(free) :]
            # No gain changes its sign, or by more than half, in a step.
            share = min(1.0, 0.5 / max(np.max(np.abs(change / gamma)), 1e-300))
            x[free] += share * move[: len(free)]
            gamma = gamma + share * change
            if share == 1.0 and step >= WEIGHED and np.max(np.abs(change / gamma)) < SETTLED:
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
    """Of each motor, from recordings without load and with each of several whose `masses` are known [kg]; `families` of
    friction of each joint, plain ones if not given; the `link` that carries them, the last if not given."""
    if len(masses) != len(loaded) or not all(mass > 0.0 for mass in masses):
        raise IdentificationError(
            f"found masses {list(masses)}, expected one above 0 kg for each of {len(loaded)} payloads"
        )
    carried = loaded_rows(robot, empty, loaded, width=width, link=link)
    rows = carried.rows
    drive = np.concatenate([x.drive for x in (*empty, *(y for each in loaded for y in each))])
    plain = plain_families(len(robot.names), robot.shared)
    model = TreeModel(robot, rows.base, plain if families is None else tuple(map(tuple, families)))
    fixed = np.zeros(len(model.names), bool)
    known = [carried.numbers(k)[0] for k in range(carried.loads)]
    fixed[known] = True
    # Least squares with any gains is a start; its scale is set by the masses.
    start, _ = fit_rows(model, rows)
    found = start.values[known]
    scale = float(np.median(np.asarray(masses) / np.where(found > 0.0, found, np.nan)))
    scale = scale if np.isfinite(scale) else 1.0
    gains = np.array(empty[0].gain if empty[0].gain is not None else np.ones(len(robot.names))) * scale
    x = start.values * np.where(_is_effort(model), scale, 1.0)
    x[known] = masses
    gamma = 1.0 / gains
    for _ in range(PARTS_OF_LOAD if model.loads else 1):
        sums = _drive_sums(model, carried, x, drive)
        gamma, x = sums.solved(gamma, x.copy(), fixed)
    if not np.all(gamma > 0.0):
        i = int(np.argmin(gamma))
        raise IdentificationError(
            f"motor of {robot.names[i]}: the payload asks for a gain below 0; check the sign of its drive and the mass"
        )
    left = np.array([1.0 / sums.without(s).solved(gamma, x.copy(), fixed)[0] for s in range(len(sums.count))])
    return tuple(_gain(robot, empty[0], i, 1.0 / gamma[i], _jackknife(left[:, i])) for i in range(len(gamma)))


def _is_effort(model: TreeModel) -> np.ndarray:
    """Which parameters grow with the scale of efforts: all but load coefficients, (p,)."""
    scales = np.ones(len(model.names), bool)
    scales[list(model.loads.values())] = False
    return scales


def _drive_sums(model: TreeModel, carried: LoadedRows, x: np.ndarray, drive: np.ndarray) -> _DriveSums:
    """Sums of the model linearised at `x`, in motors' rows."""
    rows = carried.rows
    n, m = rows.velocity.shape
    p, turns = len(model.names), np.asarray(rows.robot.turns)
    load = loads_of(rows, model, x) if model.loads else None
    at = linearised(model, replace(rows, effort=np.zeros((n, m))), load, model.alpha(x) if model.loads else None)
    back = np.linalg.inv(turns).T  # Efforts of motors = back @ efforts of joints
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
