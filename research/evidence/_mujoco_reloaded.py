"""Exports that MuJoCo loads, saves and loads again: joints, arms with random bodies, and identified arms.

The identified arms have slender links and points, and noisy recordings of little motion, so that least squares alone
finds bodies on or beyond the bound. The public UR10e is one more, where its
recordings are at hand.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pellucid.arm.fit.consistent_inertias import BODY_PARAMETER_COUNT
from pellucid.arm.fit.friction_terms import PLAIN_TERMS
from pellucid.arm.fit.inertia_prior import fit_consistent
from pellucid.arm.fit.tree_regression import TreeModel, collect_rows
from pellucid.arm.tree_motion import TreeMotion
from pellucid.controllers.export.simulator_folder import write_simulator_folder
from pellucid.controllers.export.simulator_model import SimulatorModel, joint_simulator_model, tree_simulator_model
from pellucid.models.kinematic_tree import Link, Tree, TreeJoint
from pellucid.models.robot import Robot
from pellucid.models.tree_card import TreeCard
from pellucid.study.results import ResultRow
from pellucid.study.study_file import JointLimits
from research.benchmarks._size import sized
from research.evidence._exports_read import FAMILIES, joint_card, tree_card

ARMS = sized(12, smallest=2)
"""Identified arms of random slender links."""

JOINTS = 3
"""Joints of each of them."""

SAMPLES, PERIOD_S = 1500, 0.01
"""Length and sampling period [s] of their recordings."""


def slender_arm(rng: np.random.Generator) -> Robot:
    """An arm of rods and points, with joints along random axes."""
    joints, bodies = [], []
    for i in range(JOINTS):
        axis = rng.normal(size=3)
        place = (0.0, 0.0, 0.3) if i else (0.0, 0.0, 0.0)
        joints.append(
            TreeJoint(f"joint{i}", f"link{i - 1}" if i else "base", f"link{i}", axis=tuple(axis / np.linalg.norm(axis)),
                      place=place)
        )  # fmt: skip
        thin = rng.uniform(0.0, 0.02) if i % 2 else 0.0
        bodies.append(Link.about_centre(f"link{i}", rng.uniform(0.3, 3.0), (0.0, 0.0, 0.15), (thin, 0, 0, thin, 0, 0)))
    return Robot(Tree(joints, bodies))


def identified_card(rng: np.random.Generator) -> TreeCard:
    """The card of a slender arm that was identified from noisy efforts without stated bodies."""
    robot = slender_arm(rng)
    time = PERIOD_S * np.arange(SAMPLES)
    ways = 2.0 * np.pi * rng.uniform(0.1, 0.6, (JOINTS, 3))
    phase = time[:, None, None] * ways + rng.uniform(0.0, 2.0 * np.pi, (JOINTS, 3))
    size = rng.uniform(0.1, 0.4, (JOINTS, 3))
    q, v, a = (np.sum(size * ways**k * np.sin(phase + 0.5 * np.pi * k), axis=-1) for k in range(3))
    effort = robot.tree.core.inverse_dynamics(q, v, a) + 0.3 * np.sign(v) + 0.2 * v
    effort += 0.1 * np.sqrt(np.mean(effort**2, axis=0)) * rng.normal(size=q.shape)
    motion = TreeMotion("m", "fit", time, q, v, a, effort, np.abs(v) > 0.02, np.arange(SAMPLES) * 8 // SAMPLES)
    rows = collect_rows(robot, [motion])
    stated = bool(rng.integers(2))
    model = TreeModel(robot, rows.base, (PLAIN_TERMS,) * JOINTS)
    estimate, _ = fit_consistent(model, rows, stated=stated)
    blank = tree_card(rng, JOINTS, load=False)
    links, joints = (tuple(map(tuple, each.tolist())) for each in (estimate.links(), estimate.joints()))
    return replace(blank, links=links, joints=joints)


def flat_card(rng: np.random.Generator) -> TreeCard:
    """The card of an arm of plates in random planes, which are on the bound of possible bodies."""
    blank = tree_card(rng, 4, load=False)
    links = np.array(blank.links)
    for row in links:
        points = 0.2 * rng.normal(size=(5, 2)) @ rng.normal(size=(2, 3))
        masses = rng.uniform(0.1, 1.0, 5)
        inertia = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, points, strict=True))
        row[-BODY_PARAMETER_COUNT:] = [masses.sum(), *(masses @ points), *inertia[np.triu_indices(3)]]
    return replace(blank, links=tuple(map(tuple, links.tolist())))


def models() -> Iterator[tuple[str, SimulatorModel]]:
    """Every model that is exported, by name."""
    rng = np.random.default_rng(20290117)
    for motion in ("rotary", "prismatic"):
        for name, friction in FAMILIES.items():
            yield f"{motion} {name}", joint_simulator_model(joint_card(friction, motion), JointLimits())
    for joints in (2, 4, 6):
        yield f"{joints} random bodies", tree_simulator_model(tree_card(rng, joints, load=False))
    for i in range(ARMS):
        yield f"plates {i + 1}", tree_simulator_model(flat_card(rng))
        yield f"identified arm {i + 1}", tree_simulator_model(identified_card(rng))


def is_reloaded(path: Path) -> bool:
    """Return whether MuJoCo loads a model, saves it, and loads what it saved."""
    import mujoco

    with tempfile.TemporaryDirectory() as scratch:
        saved = Path(scratch, "saved.xml")
        try:
            mujoco.mj_saveLastXML(str(saved), mujoco.MjModel.from_xml_path(str(path)))
            mujoco.MjModel.from_xml_path(str(saved))
        except ValueError:
            return False
    return True


def public_arm(scratch: Path) -> Iterator[tuple[str, Path]]:
    """The UR10e as the commands identify and export it; nothing without its recordings."""
    if not Path(os.environ.get("PELLUCID_DATA", ""), "ur10e").is_dir() or ARMS < 3:
        return
    run, folder = [sys.executable, "-m", "pellucid.cli"], scratch / "ur10e"
    for arguments in (["init", folder, "--dataset", "ur10e"], ["identify", folder],
                      ["export", folder, "--to", "mjcf"], ["export", folder, "--to", "urdf"]):  # fmt: skip
        subprocess.run([*run, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    yield "UR10e, mjcf", folder / "mjcf" / "model.xml"
    yield "UR10e, urdf", folder / "urdf" / "model.urdf"


def rows() -> Iterator[ResultRow]:
    """Share of exports that MuJoCo loads, saves and loads again."""
    with tempfile.TemporaryDirectory() as scratch:
        paths = {}
        for name, model in models():
            for kind, file in (("mjcf", "model.xml"), ("urdf", "model.urdf")):
                folder = write_simulator_folder(model, kind, Path(scratch, f"{len(paths)}"))
                paths[f"{name}, {kind}"] = folder / file
        paths |= dict(public_arm(Path(scratch)))
        failed = [name for name, path in paths.items() if not is_reloaded(path)]
    share = 100.0 * (1.0 - len(failed) / len(paths))
    note = f"{len(paths)} exports that MuJoCo loads, saves and loads again; failed: {', '.join(failed) or 'none'}"
    yield ResultRow("formats.mujoco.reloaded", share, "%", "evidence", "simulated", None, note)
