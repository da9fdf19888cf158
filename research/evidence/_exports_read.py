"""What Pellucid exports, read by the programs that it is for: their inverse dynamics against ours."""

from __future__ import annotations

import importlib.util
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np

from pellucid import _core
from pellucid.controllers.export.simulator_folder import write_simulator_folder
from pellucid.controllers.export.simulator_model import (
    joint_simulator_model,
    tree_simulator_model,
)
from pellucid.emg.files.muscle_remark import MuscleRemark, osim_numbers, write_osim
from pellucid.emg.models.hill import HillMuscle
from pellucid.emg.models.muscle import CalibratedMuscles
from pellucid.models.card import CardParameter, ModelCard
from pellucid.models.joint import SYMBOLS_BY_NAME
from pellucid.models.tree_card import JointRange, TreeCard
from pellucid.study.results import ResultRow
from pellucid.study.study_file import JointLimits

LARGEST_DIFFERENCE = 1e-6
"""Largest accepted difference of an effort, over the RMS of the efforts that are compared."""

POSTURES = 40
"""Random motions in which each export is compared."""

FAMILIES = {
    "symmetric": {"coulomb": 0.4, "viscous": 0.2},
    "directional": {
        "coulomb_positive": 0.5, "coulomb_negative": 0.3, "viscous_positive": 0.2, "viscous_negative": 0.25,
    },
    "stribeck": {"coulomb": 0.3, "viscous": 0.1, "stribeck": 0.2, "stribeck_velocity": 0.5},
    "load": {"coulomb": 0.2, "viscous": 0.1, "load_motoring": 0.15, "load_generating": 0.1, "offset": 0.05},
    "root": {"coulomb": 0.2, "viscous": 0.1, "square_root": 0.3},
}  # fmt: skip
"""Friction of the joints that are compared, by what it has."""


def joint_card(friction: dict[str, float], motion: str = "rotary") -> ModelCard:
    """A joint with this friction; a rotary one hangs."""
    slides = motion == "prismatic"
    values = {"inertia": 1.2 if slides else 0.08, **({} if slides else {"gravity": 2.5, "gravity_cosine": -0.4})}
    unit = "N" if slides else "N*m"
    parameters = tuple(
        CardParameter(n, SYMBOLS_BY_NAME[n].unit(motion, unit), v, 0.5 * w, (v - w, v + w))
        for n, v, w in ((n, v, 0.04 * abs(v)) for n, v in {**values, **friction}.items())
    )
    covariance = np.diag([p.standard_error**2 for p in parameters])
    return ModelCard(
        study="bench", family="combined", method="least squares", motion=motion, effort_unit=unit, lifts="flexion",
        parameters=parameters, covariance=tuple(map(tuple, covariance.tolist())), known={}, velocity_range=4.0,
        drive={"gain": 2.0, "back_emf": 0.3}, heldout_effort_error=None, processing="low-pass", confidence=0.95,
        checksums={}, pellucid="0", joint="elbow", purpose="simulation",
    )  # fmt: skip


def tree_card(rng: np.random.Generator, joints: int, *, load: bool) -> TreeCard:
    """A chain of hinges and slides with random bodies, rotors and friction."""
    links = np.zeros((joints, len(_core.LINK_PARAMETER_NAMES)))
    index = {name: i for i, name in enumerate(_core.LINK_PARAMETER_NAMES)}
    for i, row in enumerate(links):
        row[index["parent"]], row[index["joint"]] = i, 2 if i == 2 else 1
        row[index["x"] : index["z"] + 1] = 0.3 * rng.normal(size=3)
        row[index["roll"] : index["yaw"] + 1] = rng.uniform(-3.0, 3.0, 3)
        axis = rng.normal(size=3)
        row[index["axis_x"] : index["axis_z"] + 1] = axis / np.linalg.norm(axis)
        row[index["rotor_inertia"]] = rng.uniform(0.01, 0.3)
        points, masses = 0.2 * rng.normal(size=(8, 3)) + 0.1 * rng.normal(size=3), rng.uniform(0.1, 1.0, 8)
        inertia = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(masses, points, strict=True))
        row[index["mass"] :] = [masses.sum(), *(masses @ points), *inertia[np.triu_indices(3)]]
    friction = np.zeros((joints, len(_core.TREE_JOINT_PARAMETER_NAMES)))
    at = {name: i for i, name in enumerate(_core.TREE_JOINT_PARAMETER_NAMES)}
    for row in friction:
        row[at["coulomb_positive"]] = row[at["coulomb_negative"]] = rng.uniform(0.1, 0.6)
        row[at["viscous_positive"]] = row[at["viscous_negative"]] = rng.uniform(0.1, 0.6)
        if load:
            row[at["load_motoring"]], row[at["load_generating"]] = rng.uniform(0.05, 0.2, 2)
            row[at["coulomb_negative"]] *= 1.3
    names = tuple(f"joint{i}" for i in range(joints))
    return TreeCard(
        study="arm", family="consistent", method="weighted least squares", names=names,
        bodies=tuple(f"link{i}" for i in range(joints)), links=tuple(map(tuple, links.tolist())),
        gravity=(0.3, -0.2, -9.7), joints=tuple(map(tuple, friction.tolist())),
        turns=tuple(map(tuple, np.eye(joints).tolist())), motors=(), gains=(1.0,) * joints,
        gains_known=(True,) * joints, drive_units=("N*m",) * joints,
        effort_units=tuple("N" if row[1] == 2 else "N*m" for row in links), ranges=(JointRange(),) * joints,
        families=(("coulomb", "viscous"),) * joints, consistent=True,
        parameters=(CardParameter("joint0.viscous", "N*m*s/rad", 0.3, 0.01, (0.28, 0.32)),), covariance=((1e-4,),),
        heldout_error=(None,) * joints, processing="", confidence=0.95, notes=(), checksums={}, pellucid="0",
    )  # fmt: skip


def motions(rng: np.random.Generator, joints: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and accelerations, each shape (POSTURES, joints); no joint is near rest."""
    speed = rng.uniform(0.4, 3.0, (POSTURES, joints)) * rng.choice([-1.0, 1.0], (POSTURES, joints))
    return rng.uniform(-2.0, 2.0, (POSTURES, joints)), speed, rng.normal(size=(POSTURES, joints))


def our_joint_efforts(card: ModelCard, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Efforts of the joint, shape (n,)."""
    return _core.inverse_dynamics(card.model().vector(card.values), q, v, a)


def our_tree_efforts(card: TreeCard, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Efforts of the joints, shape (n, m)."""
    driven = card.driven(1e-3)
    return np.array([driven.motor_effort(*row) for row in zip(q, v, a, strict=True)])


def program_beside(folder: Path) -> ModuleType:
    """The friction.py of an exported folder."""
    spec = importlib.util.spec_from_file_location("exported_friction", folder / "friction.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = before
    return module


def mujoco_efforts(folder: Path, q: np.ndarray, v: np.ndarray, a: np.ndarray, *, callback: bool) -> np.ndarray:
    """Efforts by MuJoCo's inverse dynamics of an exported folder, shape (n, m), its friction program used or not."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    data = mujoco.MjData(model)
    friction = program_beside(folder).Friction(model) if callback else None
    bare = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    joints = json.loads((folder / "ranges.json").read_text())["joints"]
    offsets = np.array([numbers["offset"] for numbers in joints.values()])
    for dof in range(bare.nv):
        bare.dof_frictionloss[dof] = 0.0
        program_beside(folder).set_damping(bare, dof, 0.0)
    efforts = []
    for row in zip(q, v, a, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = row
        if friction is not None:
            plain = mujoco.MjData(bare)
            plain.qpos[:], plain.qvel[:], plain.qacc[:] = row
            mujoco.mj_inverse(bare, plain)
            friction.update(model, data, load=plain.qfrc_inverse)
        mujoco.mj_inverse(model, data)
        efforts.append(data.qfrc_inverse + offsets)
    return np.array(efforts)


def pinocchio_efforts(folder: Path, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Efforts by Pinocchio of an exported URDF with its armatures, damping and friction, shape (n, m)."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(folder / "model.urdf"))
    table = json.loads((folder / "ranges.json").read_text())
    model.gravity.linear = np.array(table["gravity"])
    if table["kind"] == "tree":
        model.armature = np.array([numbers["armature"] for numbers in table["joints"].values()])
    # Newer versions call the friction of a URDF the upper limit of dry friction.
    level = np.asarray(model.friction if hasattr(model, "friction") else model.upperDryFrictionLimit)
    data = model.createData()
    efforts = []
    for position, velocity, acceleration in zip(q, v, a, strict=True):
        placed = pinocchio.integrate(model, pinocchio.neutral(model), position)
        rigid = pinocchio.rnea(model, data, placed, velocity, acceleration)
        efforts.append(rigid + level * np.sign(velocity) + np.asarray(model.damping) * velocity)
    return np.array(efforts)


def difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest difference of two arrays of efforts over the RMS of ours."""
    return float(np.abs(ours - theirs).max() / np.sqrt(np.mean(ours**2)))


def comparisons(scratch: Path) -> Iterator[tuple[str, float]]:
    """What was compared, and the largest relative difference."""
    rng = np.random.default_rng(3)
    for motion in ("rotary", "prismatic"):
        for name, friction in FAMILIES.items():
            card = joint_card(friction, motion)
            model = joint_simulator_model(card, JointLimits())
            q, v, a = motions(rng, 1)
            ours = our_joint_efforts(card, q[:, 0], v[:, 0], a[:, 0])[:, None]
            folder = write_simulator_folder(model, "mjcf", scratch / f"{motion}_{name}")
            yield f"MuJoCo, {motion}, {name}", difference(ours, mujoco_efforts(folder, q, v, a, callback=True))
            if name == "symmetric":
                alone = mujoco_efforts(folder, q, v, a, callback=False)
                yield f"MuJoCo alone, {motion}, {name}", difference(ours, alone)
                folder = write_simulator_folder(model, "urdf", scratch / f"{motion}_{name}_urdf")
                yield f"Pinocchio, {motion}, {name}", difference(ours, pinocchio_efforts(folder, q, v, a))
    for joints, load in ((2, False), (4, False), (4, True)):
        tree = tree_card(rng, joints, load=load)
        several = tree_simulator_model(tree)
        q, v, a = motions(rng, joints)
        ours = our_tree_efforts(tree, q, v, a)
        folder = write_simulator_folder(several, "mjcf", scratch / f"tree_{joints}_{load}")
        yield f"MuJoCo, {joints} joints", difference(ours, mujoco_efforts(folder, q, v, a, callback=True))
        if not load:
            folder = write_simulator_folder(several, "urdf", scratch / f"tree_{joints}_urdf")
            yield f"Pinocchio, {joints} joints", difference(ours, pinocchio_efforts(folder, q, v, a))


def muscle_comparisons() -> Iterator[tuple[str, float]]:
    """Constants of muscles that OpenSim reads in a model that Pellucid exported; nothing where it is not installed."""
    source = Path(os.environ.get("PELLUCID_DATA", "")) / "gait2392_muscles" / "gait2392_thelen2003muscle.osim"
    if importlib.util.find_spec("opensim") is None or not source.is_file():
        return
    import opensim

    opensim.Logger.setLevelString("error")
    known = {"vas_lat_r": (0.0871, 0.2, 1234.5, 0.151), "soleus_r": (0.0523, 0.25, 3549.0, 0.241)}
    muscles = tuple(
        HillMuscle(name, fibre, pennation, force, slack, -1.7, 0.02, 0.03, 0.04, 1.0, damping=0.05)
        for name, (fibre, pennation, force, slack) in known.items()
    )
    driven = {name: (name,) for name in known}
    kept = CalibratedMuscles(muscles, driven, {"knee": (0.0, 0.0, 0.0)}, 1.0)
    with tempfile.TemporaryDirectory() as scratch:
        path = write_osim(Path(scratch, "made.osim"), source, MuscleRemark(kept, {name: name for name in known}))
        model = opensim.Model(str(path))
        model.initSystem()
        for muscle in muscles:
            found = opensim.Muscle.safeDownCast(model.getMuscles().get(muscle.name))
            wanted = osim_numbers(muscle)
            read = {
                "max_isometric_force": found.getMaxIsometricForce(),
                "optimal_fiber_length": found.getOptimalFiberLength(),
                "tendon_slack_length": found.getTendonSlackLength(),
                "pennation_angle_at_optimal": found.getPennationAngleAtOptimalFiberLength(),
            }
            yield f"OpenSim, {muscle.name}", max(abs(read[key] / wanted[key] - 1.0) for key in read)


def rows() -> Iterator[ResultRow]:
    """Yield the number of exports that another program reads, and the number with other efforts than ours."""
    with tempfile.TemporaryDirectory() as scratch:
        found = dict(comparisons(Path(scratch)))
    found |= dict(muscle_comparisons())
    unequal = [name for name, error in found.items() if not error <= LARGEST_DIFFERENCE]

    def row(name: str, value: float, note: str) -> ResultRow:
        return ResultRow(f"formats.exports_read_by_others.{name}", value, "1", "evidence", "simulated", None, note)

    yield row("count", len(found), ", ".join(found))
    yield row("unequal", len(unequal), ", ".join(unequal))
    yield row("largest_difference", max(found.values()), "of an effort, over the RMS of the efforts")
