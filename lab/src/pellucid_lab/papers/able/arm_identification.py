"""Record and identify virtual arms of four joints, and test the models on people's motions, which are never fitted.

A cable loses different shares of the load while it lifts and while it lowers. Lifting takes (1 + a) of the load and
lowering (1 - b). Their mean, 1 + (a - b) / 2, scales the joint's whole torque as a wrong gain of its drive would, and
no motion separates it from the masses. A payload of known mass does: its weight determines every joint's gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pellucid._errors import DatasetError
from pellucid.arm.fit.consistent_inertias import least_eigenvalue
from pellucid.arm.fit.fit_tree import fit_best_model, fit_tree, heldout_errors, make_tree_estimate
from pellucid.arm.fit.inertia_prior import fit_consistent
from pellucid.arm.fit.payload import gains_from_payload, with_drive_gains
from pellucid.arm.fit.tree_estimate import TreeEstimate
from pellucid.arm.fit.tree_regression import collect_rows
from pellucid.arm.tree_motion import TreeMotion

from ...arm.card_law import card_of, motions_of
from ...arm.human_motion import JOINTS, generated_motion, people, recorded_motion
from ...arm.protocol import ArmTrial, followed
from ...arm.rig import ArmRig
from ...processes import ordered_results
from .directional_sets import DirectionalRow, compare_directional
from .held_joints import hold_joints

LOAD_FRICTION_FAMILY = ("viscous", "coulomb", "offset", "load")
"""Friction terms of every joint of the model with load friction."""

MAX_MOTION_S = 40.0
"""A person's motion is cut to this length."""

TEST_PEOPLE_COUNT = 3
"""Number of people whose motions the test set contains."""

GRAVITY_TEST_POSTURES = 500
"""Number of postures, drawn within the stops, in which gravity is compared with the truth."""

PAYLOAD_KG = 1.5
"""Mass of the payload in the handle."""


@dataclass(frozen=True, eq=False)
class IdentifiedArm:
    """One arm identified from one seed's recordings, with its errors on people's motions."""

    rig: str
    seed: int
    errors: dict[str, np.ndarray]  # Errors of each joint's torque, by model, (4,) [%]
    gravity: dict[str, float]  # Largest error of gravity over its largest torque, by model [%]
    least_eigenvalue: float  # Smallest eigenvalue of all links' pseudo-inertias; a real body has it above 0
    parameters: dict[str, int]  # Number of parameters by model
    judged: str  # Source of the test motions: "people" or "generated reaching"
    gains: np.ndarray  # (4,) Drive gains from the payload over the stated gains [1]
    best: TreeEstimate  # Base parameters with the friction that fits best, gains from the payload
    consistent: TreeEstimate  # Physically consistent bodies, gains from the payload


def draw_test_motions(rig: ArmRig, count: int = TEST_PEOPLE_COUNT) -> tuple[str, tuple[ArmTrial, ...]]:
    """Return the source of the test motions, and motions of `count` people, or generated reaching without the data."""
    rate, slider = rig["sampling"]["rate"], rig["slider"]["clamped"]
    try:
        source, motions = "people", [recorded_motion(name, rate) for name in people()[:count]]
    except DatasetError:
        source, motions = "generated reaching", [generated_motion(100 + i, rate, MAX_MOTION_S) for i in range(count)]
    trials = [followed(motion, slider=slider) for motion in motions]
    return source, tuple(replace(t, reference=t.reference[: round(MAX_MOTION_S * rate)]) for t in trials)


def add_payload(rig: ArmRig, mass: float = PAYLOAD_KG) -> ArmRig:
    """Return the same arm with a `mass` [kg] in its handle."""
    carriage = rig["link"]["carriage"]
    whole = carriage["mass"] + mass
    centre = [carriage["mass"] * x / whole for x in carriage["centre"]]
    return rig.changed({"link.carriage.mass": whole, "link.carriage.centre": centre}, f"{rig.name}-loaded")


def gravity_error(rig: ArmRig, estimate: TreeEstimate) -> float:
    """Return the largest error of gravity's torque over its largest torque, in postures within the stops [%]."""
    joints = [rig["joint"][name] for name in JOINTS]
    rng = np.random.default_rng(20261122)
    q = rng.uniform([j["low"] for j in joints], [j["high"] for j in joints], (GRAVITY_TEST_POSTURES, len(joints)))
    found = card_of(rig, estimate).tree.gravity(q)
    true = rig.gravity(q)
    return 100.0 * float(np.abs(found - true).max() / np.abs(true).max())


def identified(rig: ArmRig, seed: int = 1) -> IdentifiedArm:
    """Record a rig's protocol with and without payload, and people's motions; fit the protocol, test on the motions."""
    robot = rig.robot
    trials = [t for t in rig.trials(seed) if t.use == "fit"]
    empty, loaded = motions_of(rig, trials, seed), motions_of(add_payload(rig), trials, 100 + seed)
    source, test_trials = draw_test_motions(rig)
    judged = motions_of(rig, test_trials, 1000 + seed)
    families = (LOAD_FRICTION_FAMILY,) * len(JOINTS)
    plain, stated = fit_tree(robot, empty, name="plain"), fit_tree(robot, empty, families, name="load")
    gains = np.array([p.value for p in gains_from_payload(robot, empty, [loaded], [PAYLOAD_KG], families)])
    by_weight, others = ([with_drive_gains(m, robot, gains) for m in motions] for motions in (empty, judged))
    load = fit_tree(robot, by_weight, families, name="load")
    rows = collect_rows(robot, by_weight)
    _, _, found, at = fit_best_model(rows, by_weight[0].rate)
    best = make_tree_estimate("best", rows, found, at)
    # The rig's own bodies are the truth, and no prior.
    consistent, _ = fit_consistent(at.model, rows, start=found, stated=False)
    errors = {"plain": heldout_errors(plain, judged), "load_stated_gains": heldout_errors(stated, judged)}
    errors |= {e.name: heldout_errors(e, others) for e in (load, best, consistent)}
    every = {"plain": plain, "load_stated_gains": stated, "load": load, "best": best, "consistent": consistent}
    return IdentifiedArm(
        rig.name,
        seed,
        errors,
        {name: gravity_error(rig, estimate) for name, estimate in every.items()},
        float(least_eigenvalue(np.ascontiguousarray(consistent.links()[:, -10:])).min()),
        {name: len(estimate.array) for name, estimate in every.items()},
        source,
        gains / rig.gains,
        best,
        consistent,
    )


def identified_many(jobs: Sequence[tuple[ArmRig, int]], workers: int | None = None) -> list[IdentifiedArm]:
    """Return `identified` of several pairs of rig and seed, each computed in a process."""
    return ordered_results([(identified, *job) for job in jobs], workers)


HELD_JOINT_ANGLES_RAD = {"abduction": 0.5, "flexion": 0.6, "internal_rotation": 0.2}
"""Angles of the joints that do not move in a comparison with fewer joints."""


def directional(rig: ArmRig, seed: int, joints: int, judges: int = TEST_PEOPLE_COUNT) -> tuple[DirectionalRow, ...]:
    """Compare directional parameter sets with one body; the last `joints` of the arm move, the others are held."""
    held = {name: HELD_JOINT_ANGLES_RAD[name] for name in JOINTS[: len(JOINTS) - joints]}
    robot = hold_joints(rig.robot, held) if held else rig.robot

    def only(trials: Sequence[ArmTrial], noise: int) -> list[TreeMotion]:
        still = [replace(t, reference=_hold_joints_still(t.reference, held)) for t in trials]
        return [_keep_last_joints(m, joints) for m in motions_of(rig, still, noise)]

    fitted = only([t for t in rig.trials(seed) if t.use == "fit"], seed)
    return compare_directional(robot, fitted, only(draw_test_motions(rig, judges)[1], 1000 + seed))


def _hold_joints_still(reference: np.ndarray, held: dict[str, float]) -> np.ndarray:
    """Return a reference, (n, 4) [rad], whose first joints stay at the angles of `held`."""
    made = np.array(reference)
    made[:, : len(held)] = list(held.values())
    return made


def _keep_last_joints(motion: TreeMotion, joints: int) -> TreeMotion:
    """Return a motion with the columns of its last `joints` alone."""
    of_joints = ("position", "velocity", "acceleration", "effort", "moving", "still", "drive")
    columns = {name: np.ascontiguousarray(getattr(motion, name)[:, -joints:]) for name in of_joints}
    recorded = motion.recorded and replace(motion.recorded, velocity=motion.recorded.velocity[:, -joints:])
    return replace(motion, **columns, gain=motion.gain[-joints:], recorded=recorded)


def directional_many(
    jobs: Sequence[tuple[ArmRig, int, int]], workers: int | None = None
) -> list[tuple[DirectionalRow, ...]]:
    """Return `directional` of several tuples of rig, seed and number of joints, each computed in a process."""
    return ordered_results([(directional, *job) for job in jobs], workers)
