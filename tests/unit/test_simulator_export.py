"""A joint and a robot for simulators: what MuJoCo and Pinocchio compute of them is what we compute."""

import json
from dataclasses import replace

import numpy as np
import pytest
from research.evidence._exports_read import (
    FAMILIES,
    difference,
    joint_card,
    motions,
    mujoco_efforts,
    our_joint_efforts,
    our_tree_efforts,
    pinocchio_efforts,
    program_beside,
    tree_card,
)
from research.evidence._mujoco_reloaded import flat_card, is_reloaded

import pellucid
from pellucid._errors import PellucidError
from pellucid.controllers.export.simulator_folder import describe_simulator_model, write_simulator_folder
from pellucid.controllers.export.simulator_model import joint_simulator_model, require_bodies, tree_simulator_model
from pellucid.models.card import write_card
from pellucid.study.study_file import JointLimits

EQUAL = 1e-6


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("motion", ["rotary", "prismatic"])
def test_mujoco_asks_for_the_same_effort(tmp_path, rng, family, motion):
    pytest.importorskip("mujoco")
    card = joint_card(FAMILIES[family], motion)
    folder = write_simulator_folder(joint_simulator_model(card, JointLimits()), "mjcf", tmp_path)
    q, v, a = motions(rng, 1)
    ours = our_joint_efforts(card, q[:, 0], v[:, 0], a[:, 0])[:, None]
    assert difference(ours, mujoco_efforts(folder, q, v, a, callback=True)) < EQUAL
    alone = difference(ours, mujoco_efforts(folder, q, v, a, callback=False))
    assert alone < EQUAL if family == "symmetric" else alone > 1e-3


@pytest.mark.parametrize("load", [False, True])
def test_a_robot_of_several_joints_is_the_same_in_mujoco(tmp_path, rng, load):
    pytest.importorskip("mujoco")
    card = tree_card(rng, 4, load=load)
    folder = write_simulator_folder(tree_simulator_model(card), "mjcf", tmp_path)
    q, v, a = motions(rng, 4)
    assert difference(our_tree_efforts(card, q, v, a), mujoco_efforts(folder, q, v, a, callback=True)) < EQUAL


@pytest.mark.parametrize(("kind", "file"), [("mjcf", "model.xml"), ("urdf", "model.urdf")])
def test_mujoco_saves_and_reloads_bodies_on_the_bound(tmp_path, rng, kind, file):
    """Plates, of which two moments together are the third: six digits are not enough to keep them possible."""
    pytest.importorskip("mujoco")
    for i in range(4):
        folder = write_simulator_folder(tree_simulator_model(flat_card(rng)), kind, tmp_path / f"{i}")
        assert is_reloaded(folder / file)


def test_pinocchio_reads_the_urdf(tmp_path, rng):
    pytest.importorskip("pinocchio")
    card = tree_card(rng, 3, load=False)
    folder = write_simulator_folder(tree_simulator_model(card), "urdf", tmp_path / "tree")
    q, v, a = motions(rng, 3)
    assert difference(our_tree_efforts(card, q, v, a), pinocchio_efforts(folder, q, v, a)) < EQUAL
    joint = joint_card(FAMILIES["symmetric"])
    folder = write_simulator_folder(joint_simulator_model(joint, JointLimits()), "urdf", tmp_path / "joint")
    q, v, a = motions(rng, 1)
    ours = our_joint_efforts(joint, q[:, 0], v[:, 0], a[:, 0])[:, None]
    assert difference(ours, pinocchio_efforts(folder, q, v, a)) < EQUAL


def test_our_own_reader_takes_the_urdf(tmp_path, rng):
    card = tree_card(rng, 3, load=False)
    folder = write_simulator_folder(tree_simulator_model(card), "urdf", tmp_path)
    assert pellucid.read_robot(folder / "model.urdf").names == card.names


def test_draws_stay_within_intervals_and_reach_the_model(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    card = joint_card(FAMILIES["load"])
    folder = write_simulator_folder(joint_simulator_model(card, JointLimits()), "mjcf", tmp_path)
    program, drawn = program_beside(folder), np.random.default_rng(4)
    draws = [program.sample(drawn) for _ in range(300)]
    for parameter in card.parameters:
        found = np.array([draw[parameter.name] for draw in draws])
        assert found.min() >= min(parameter.interval)
        assert found.max() <= max(parameter.interval)
        assert np.std(found) > 0.5 * parameter.standard_error
    model = program.apply(mujoco.MjModel.from_xml_path(str(folder / "model.xml")), draws[0])
    data = mujoco.MjData(model)
    data.qacc[0] = 1.0
    model.dof_frictionloss[0] = 0.0
    mujoco.mj_inverse(model, data)
    # At rest in the zero angle, gravity's sine does not act, and its cosine does.
    expected = draws[0]["inertia"] + draws[0]["gravity_cosine"]
    assert data.qfrc_inverse[0] == pytest.approx(expected, rel=1e-9)
    friction = program.Friction(model)
    friction.set(draws[0])
    assert friction.joints[0][1]["load_motoring"] == draws[0]["load_motoring"]


def test_friction_holds_a_hanging_joint_and_lets_it_slip(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    card = joint_card({"coulomb": 0.4, "viscous": 0.2})
    folder = write_simulator_folder(joint_simulator_model(card, JointLimits()), "mjcf", tmp_path)
    for effort, moves in ((0.3, False), (0.6, True)):
        model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
        data, friction = mujoco.MjData(model), program_beside(folder).Friction(model)
        # The equilibrium of gravity's sine and cosine.
        data.qpos[0] = start = float(np.arctan2(0.4, 2.5))
        data.ctrl[0] = effort / 2.0  # the drive's gain
        for _ in range(300):
            friction.update(model, data)
            mujoco.mj_step(model, data)
        assert bool(abs(data.qpos[0] - start) > 0.01) is moves


def test_limits_reach_the_model(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    limits = JointLimits.model_construct(position_min=-1.0, position_max=2.0, effort=5.0, velocity=3.0)
    found = joint_simulator_model(joint_card(FAMILIES["symmetric"]), limits)
    folder = write_simulator_folder(found, "mjcf", tmp_path)
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    assert model.jnt_range[0].tolist() == [-1.0, 2.0]
    assert model.actuator_forcerange[0].tolist() == [-5.0, 5.0]
    text = (write_simulator_folder(found, "urdf", tmp_path) / "model.urdf").read_text()
    assert '<limit lower="-1.0" upper="2.0" effort="5.0" velocity="3.0"/>' in text


def test_what_no_simulator_takes_is_refused(rng):
    card = joint_card(FAMILIES["symmetric"])
    with pytest.raises(PellucidError, match=r"found an effort in A, expected one in N\*m: a simulator needs"):
        joint_simulator_model(replace(card, effort_unit="A"), JointLimits())
    tree = tree_card(rng, 2, load=False)
    with pytest.raises(PellucidError, match="found physically inconsistent inertias"):
        tree_simulator_model(replace(tree, consistent=False))
    motors = ((0.0,) * 11,) * 2
    with pytest.raises(PellucidError, match="found motors that turn with several joints"):
        tree_simulator_model(replace(tree, turns=((1.0, 0.0), (1.0, 1.0)), motors=motors))
    model = tree_simulator_model(tree)
    odd = replace(model.bodies[0], inertia=np.diag([1.0, 0.1, 0.1]))
    with pytest.raises(PellucidError, match=r"link link0: found the principal moments of inertia 0\.1, 0\.1, 1"):
        require_bodies(replace(model, bodies=(odd, *model.bodies[1:])))


def test_the_command_writes_a_folder_of_its_own(tmp_path):
    from research.evidence._healthy import healthy

    study_folder = next(path for path in healthy(tmp_path, 300, endings=(".csv",)))
    study = pellucid.open(study_folder)
    study.models_dir.mkdir()
    write_card(study.models_dir / "joint.json", replace(joint_card(FAMILIES["load"]), study="bench", purpose="torque"))
    for to, file in (("mjcf", "model.xml"), ("urdf", "model.urdf")):
        folder = pellucid.export(study, to)
        assert folder == study_folder / to
        assert (folder / file).is_file()
        assert json.loads((folder / "ranges.json").read_text())["joints"]["elbow"]["load_motoring"] == 0.15
    assert "Its numbers were chosen for the torque" in describe_simulator_model(folder)
    with pytest.raises(PellucidError, match="found slider, expected none: a model for simulators has none"):
        pellucid.export(study, "mjcf", slider=0.1)
    with pytest.raises(PellucidError, match="found slider, load, expected none: a model for simulators has none"):
        pellucid.export(study, "mjcf", slider=0.0, load=(1.0, 0.2))
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "model.xml").write_text("mine")
    with pytest.raises(PellucidError, match=r"found model\.xml, which an export of Pellucid did not write"):
        pellucid.export(study, "mjcf", tmp_path / "other")
