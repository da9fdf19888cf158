"""Decide whether the effort of a joint also follows the motion of others, which a model of the joint alone lacks.

Joints of one robot act on each other by inertia that they share, by their weight, whose angle depends on all joints
before, and by centripetal and Coriolis forces. All of these are products of sines and cosines of the angles with
accelerations and speeds. If such products of another joint's motion explain what the joint's own model leaves over, on
blocks of the recordings that had no part in the fit, the joints are coupled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..._errors import PellucidError
from ...models.estimates import Verdict
from ...numerics.motion import Motion
from ...study.answer import Step
from ...study.pages.quantities import percent
from ...study.procedures.findings import ROBOT_ADVICE
from ...study.procedures.result import Result
from ...study.recorded_motions import motions_of
from ...study.study import Study
from .joint_result import JointResult


@dataclass(frozen=True)
class CouplingLimits:
    """When joints count as coupled. Chosen by judgement, and checked on simulated arms of two joints."""

    max_rows: int = 4000  # so many rows of a joint are compared, evenly spaced
    min_rows: int = 400  # with fewer rows nothing is decided
    blocks: int = 10  # blocks of rows that are predicted from the others
    # Joints are coupled if the others' motion takes at least this share off the squared error.
    min_gain: float = 0.3
    # Another joint is named if its motion alone takes at least this share off.
    min_gain_of_one: float = 0.1
    # Coupling below this error, in percent of the effort, is not worth a warning.
    min_error_percent: float = 1.0


COUPLING_LIMITS = CouplingLimits()

ROBOT_STEP = Step(ROBOT_ADVICE)
"""The same as a step."""


@dataclass(frozen=True)
class Coupling:
    """How much of a joint's effort follows the motion of others; errors in percent of the effort."""

    others: tuple[str, ...]  # joints whose motion it follows
    own_error: float  # error on left-out blocks by the joint's own motion
    joint_error: float  # the same with the motion of all joints


def coupling_verdicts(views: Mapping[str, Study], joints: Mapping[str, Result]) -> list[Verdict]:
    """Return a warning for each joint whose effort follows other joints, or one note that each was taken alone."""
    motions: dict[str, tuple[Motion, ...]] = {}
    for name, view in views.items():
        try:
            motions[name] = motions_of(view.recordings("fit"), view)
        except PellucidError:
            continue  # a locked spring, or postures
    verdicts = []
    for name, found in joints.items():
        others = {other: moved for other, moved in motions.items() if other != name}
        coupling = find_coupling(found, others) if isinstance(found, JointResult) and others else None
        if coupling is None:
            continue
        text = (
            f"The effort of {name} also depends on the motion of {', '.join(coupling.others)}, which reduces its "
            f"cross-validated error from {percent(coupling.own_error)} % to {percent(coupling.joint_error)} %. The "
            f"parameters of {name} are averages over that motion."
        )
        verdicts.append(Verdict("warning", text, ROBOT_ADVICE, "coupled_joints", coupling.own_error))
    if not verdicts and len(views) > 1:
        text = "Each joint was identified separately; the effect of one joint's motion on another is not modelled."
        verdicts.append(Verdict("note", text, ROBOT_ADVICE, "each_joint"))
    return verdicts


def find_coupling(found: JointResult, others: Mapping[str, tuple[Motion, ...]]) -> Coupling | None:
    """Return how a joint's effort follows the motion of others; None if nothing shows that it does."""
    parts = [p for p in found.headlined.predictions if p.split == "fitted"]
    rows = sum(len(p.time) for p in parts)
    step = max(1, -(-rows // COUPLING_LIMITS.max_rows))
    own, effort, left = [], [], []
    moved: dict[str, list[np.ndarray]] = {name: [] for name in others}
    for p in parts:
        time, q, v, a, measured = (x[::step] for x in (p.time, p.position, p.velocity, p.acceleration, p.effort))
        own.append(_own_features(q, v, a, found.motion == "rotary"))
        effort.append(measured)
        left.append(measured - p.predicted[::step])
        for name, motions in others.items():
            moved[name].append(_coupled_features(q, v, a, *_motion_at(time, p.recording, motions)))
    if rows < COUPLING_LIMITS.min_rows:
        return None
    alone, residual = np.concatenate(own), np.concatenate(left)
    coupled = {name: np.concatenate(each) for name, each in moved.items()}
    usable = np.isfinite(np.column_stack(list(coupled.values()))).all(axis=1)
    if usable.sum() < COUPLING_LIMITS.min_rows:
        return None
    alone, residual, size = alone[usable], residual[usable], float(np.linalg.norm(np.concatenate(effort)[usable]))
    coupled = {name: each[usable] for name, each in coupled.items()}
    before = _left_out_error(alone, residual)
    after = _left_out_error(np.column_stack([alone, *coupled.values()]), residual)
    own_error, joint_error = (100.0 * np.sqrt(x) / size for x in (before, after))
    if 1.0 - after / before < COUPLING_LIMITS.min_gain or own_error < COUPLING_LIMITS.min_error_percent:
        return None
    single = {
        name: 1.0 - _left_out_error(np.column_stack([alone, x]), residual) / before for name, x in coupled.items()
    }
    named = tuple(name for name, gain in single.items() if gain >= COUPLING_LIMITS.min_gain_of_one)
    return Coupling(named or (max(single, key=single.__getitem__),), float(own_error), float(joint_error))


def _motion_at(time: np.ndarray, recording: str, motions: tuple[Motion, ...]) -> tuple[np.ndarray, ...]:
    """Return position, velocity and acceleration, (n,) each, of another joint at the times of a recording [s].

    NaN where the other joint has no samples.
    """
    found = tuple(np.full(len(time), np.nan) for _ in range(3))
    for motion in motions:
        if motion.recording != recording or not len(motion.time[motion.inner]):
            continue
        known = motion.time[motion.inner]
        inside = (time >= known[0]) & (time <= known[-1])
        for made, signal in zip(found, ("position", "velocity", "acceleration"), strict=True):
            made[inside] = np.interp(time[inside], known, getattr(motion, signal)[motion.inner])
    return found


def _own_features(q: np.ndarray, v: np.ndarray, a: np.ndarray, turns: bool) -> np.ndarray:
    """Return what the residual of a model may still follow of the joint's own motion, (n, f)."""
    place = (np.sin(q), np.cos(q)) if turns else (q,)
    return np.column_stack([np.ones_like(q), *place, v, np.sign(v), v * np.abs(v), a])


def _coupled_features(
    q: np.ndarray, v: np.ndarray, a: np.ndarray, other_q: np.ndarray, other_v: np.ndarray, other_a: np.ndarray
) -> np.ndarray:
    """Return the products by which another joint's motion can act on a joint, (n, f)."""
    sine, cosine = np.sin(other_q), np.cos(other_q)
    carried = [x * y for x in (np.sin(q), np.cos(q), a, other_a, v * other_v, other_v**2) for y in (sine, cosine)]
    return np.column_stack([sine, cosine, other_a, *carried])


def _left_out_error(features: np.ndarray, target: np.ndarray) -> float:
    """Return the squared error of blocks of rows, each predicted by a linear fit of the others."""
    features = features / np.maximum(np.linalg.norm(features, axis=0), 1e-300)
    error = 0.0
    for block in np.array_split(np.arange(len(target)), COUPLING_LIMITS.blocks):
        kept = np.ones(len(target), bool)
        kept[block] = False
        fit = np.linalg.lstsq(features[kept], target[kept], rcond=1e-6)[0]
        error += float(np.sum((target[block] - features[block] @ fit) ** 2))
    return error
