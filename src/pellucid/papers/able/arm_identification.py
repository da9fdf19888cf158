"""Virtual arms of four joints recorded, identified, and judged on how people move, which nothing was fitted to.

What a cable loses of a load while it lifts and while it lowers differs. Lifting takes (1 + a) of the load and lowering
(1 - b): the mean, 1 + (a - b) / 2, is a factor on all that the joint feels, as a wrong gain of its drive would be, and
no motion tells it from the masses. A known payload does: its weight sets every joint's gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import DatasetError
from ..._processes import ordered_results
from ...fit.tree.consistent_fit import fit_consistent
from ...fit.tree.directional_sets import DirectionalRow, compare_directional
from ...fit.tree.drive_gains import gains_from_payload
from ...fit.tree.fit_tree import fit_tree, make_tree_estimate
from ...fit.tree.identify_tree import fit_best_model
from ...fit.tree.payload import with_drive_gains
from ...fit.tree.segments_out import heldout_errors
from ...fit.tree.tree_estimate import TreeEstimate
from ...fit.tree.tree_regression import collect_rows
from ...lab.arm.card_law import card_of, motions_of
from ...lab.arm.human_motion import JOINTS, generated_motion, people, recorded_motion
from ...lab.arm.protocol import ArmTrial, followed
from ...lab.arm.rig import ArmRig
from ...models.held_joints import hold_joints
from ...models.pseudo_inertia import least_eigenvalue
from ...signals.tree_motion import TreeMotion

LOAD = ("viscous", "coulomb", "offset", "load")
LONGEST = 40.0  # s of a person's motion
JUDGES = 3  # people whose motion is followed
POSTURES = 500  # drawn within the stops, in which gravity is judged
PAYLOAD = 1.5  # kg, in the handle


@dataclass(frozen=True, eq=False)
class ArmIdentified:
    """One arm from one seed's recordings: errors on people's motions, gravity, bodies."""

    rig: str
    seed: int
    errors: dict[str, np.ndarray]  # Of each joint's torque, by model, (4,) [%]
    gravity: dict[str, float]  # Largest error over the largest torque, by model [%]
    least_eigenvalue: float  # Of all links' pseudo-inertias
    parameters: dict[str, int]
    judged: str  # Whose motions
    gains: np.ndarray  # (4,) by the payload, over those stated [1]
    best: TreeEstimate  # With the payload's gains
    consistent: TreeEstimate


def judging(rig: ArmRig, count: int = JUDGES) -> tuple[str, tuple[ArmTrial, ...]]:
    """How `count` people moved, or generated reaching where they are not here, and which of both."""
    rate, slider = rig["sampling"]["rate"], rig["slider"]["clamped"]
    try:
        said, motions = "people", [recorded_motion(name, rate) for name in people()[:count]]
    except DatasetError:
        said, motions = "generated reaching", [generated_motion(100 + i, rate, LONGEST) for i in range(count)]
    trials = [followed(motion, slider=slider) for motion in motions]
    return said, tuple(replace(t, reference=t.reference[: round(LONGEST * rate)]) for t in trials)


def with_payload(rig: ArmRig, mass: float = PAYLOAD) -> ArmRig:
    """The same arm with a `mass` [kg] in its handle."""
    own = rig["link"]["carriage"]
    whole = own["mass"] + mass
    centre = [own["mass"] * x / whole for x in own["centre"]]
    return rig.changed({"link.carriage.mass": whole, "link.carriage.centre": centre}, f"{rig.name}-loaded")


def gravity_error(rig: ArmRig, estimate: TreeEstimate) -> float:
    """Largest error of gravity's torque over the largest torque, over postures within the stops [%]."""
    said = [rig["joint"][name] for name in JOINTS]
    rng = np.random.default_rng(20261122)
    q = rng.uniform([s["low"] for s in said], [s["high"] for s in said], (POSTURES, len(said)))
    found = card_of(rig, estimate).tree.gravity(q)
    true = rig.gravity(q)
    return 100.0 * float(np.abs(found - true).max() / np.abs(true).max())


def identified(rig: ArmRig, seed: int = 1) -> ArmIdentified:
    """Record a rig's own protocol, with a payload and without, and how people move; fit the first alone."""
    robot = rig.robot
    trials = [t for t in rig.trials(seed) if t.use == "fit"]
    empty, loaded = motions_of(rig, trials, seed), motions_of(with_payload(rig), trials, 100 + seed)
    said, judges = judging(rig)
    judged = motions_of(rig, judges, 1000 + seed)
    families = (LOAD,) * len(JOINTS)
    plain, stated = fit_tree(robot, empty, name="plain"), fit_tree(robot, empty, families, name="load")
    gains = np.array([p.value for p in gains_from_payload(robot, empty, [loaded], [PAYLOAD], families)])
    by_weight, others = ([with_drive_gains(m, robot, gains) for m in motions] for motions in (empty, judged))
    load = fit_tree(robot, by_weight, families, name="load")
    rows = collect_rows(robot, by_weight)
    _, _, found, at = fit_best_model(rows, by_weight[0].rate)
    best = make_tree_estimate("best", rows, found, at)
    consistent = fit_consistent(at.model, rows, start=found)
    errors = {"plain": heldout_errors(plain, judged), "load_stated_gains": heldout_errors(stated, judged)}
    errors |= {e.name: heldout_errors(e, others) for e in (load, best, consistent)}
    every = {"plain": plain, "load_stated_gains": stated, "load": load, "best": best, "consistent": consistent}
    return ArmIdentified(
        rig.name,
        seed,
        errors,
        {name: gravity_error(rig, estimate) for name, estimate in every.items()},
        float(least_eigenvalue(np.ascontiguousarray(consistent.links()[:, -10:])).min()),
        {name: len(estimate.array) for name, estimate in every.items()},
        said,
        gains / rig.gains,
        best,
        consistent,
    )


def identified_many(jobs: Sequence[tuple[ArmRig, int]], workers: int | None = None) -> list[ArmIdentified]:
    """Several, in processes of their own."""
    return ordered_results([(identified, *job) for job in jobs], workers)


HOLDING = {"abduction": 0.5, "flexion": 0.6, "internal_rotation": 0.2}
"""Where joints stay that a comparison of fewer leaves out [rad]."""


def directional(rig: ArmRig, seed: int, joints: int, judges: int = JUDGES) -> tuple[DirectionalRow, ...]:
    """Sets by directions beside one body, the last `joints` of the arm moving and the others held."""
    held = {name: HOLDING[name] for name in JOINTS[: len(JOINTS) - joints]}
    robot = hold_joints(rig.robot, held) if held else rig.robot

    def only(trials: Sequence[ArmTrial], noise: int) -> list[TreeMotion]:
        still = [replace(t, reference=_still(t.reference, held)) for t in trials]
        return [_moving(m, joints) for m in motions_of(rig, still, noise)]

    fitted = only([t for t in rig.trials(seed) if t.use == "fit"], seed)
    return compare_directional(robot, fitted, only(judging(rig, judges)[1], 1000 + seed))


def _still(reference: np.ndarray, held: dict[str, float]) -> np.ndarray:
    made = np.array(reference)
    made[:, : len(held)] = list(held.values())
    return made


def _moving(motion: TreeMotion, joints: int) -> TreeMotion:
    """The last joints alone."""
    of_joints = ("position", "velocity", "acceleration", "effort", "moving", "still", "drive")
    columns = {name: np.ascontiguousarray(getattr(motion, name)[:, -joints:]) for name in of_joints}
    return replace(motion, **columns, gain=motion.gain[-joints:])


def directional_many(
    jobs: Sequence[tuple[ArmRig, int, int]], workers: int | None = None
) -> list[tuple[DirectionalRow, ...]]:
    """Several, in processes of their own."""
    return ordered_results([(directional, *job) for job in jobs], workers)
