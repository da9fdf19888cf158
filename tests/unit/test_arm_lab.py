"""The virtual arm: what it is made of, what it records, who wears it."""

import json
import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pellucid._errors import StudyError
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.tree_laws import carried, with_force_sensor
from pellucid.models.kinematic_tree import BODY_QUANTITIES
from pellucid_lab.arm.bodies import JOINT_NUMBERS, built_tree
from pellucid_lab.arm.card_law import CardLaw, card_of, sensor_points
from pellucid_lab.arm.free_shoulder import LAWS, ElbowAndShoulder, elbow_constants, figures_of, pointing
from pellucid_lab.arm.human_motion import JOINTS, generated_motion
from pellucid_lab.arm.protocol import ArmTrial, limits_of
from pellucid_lab.arm.rig import able_arm, drawn_arms
from pellucid_lab.arm.single_faults import fault_trials
from pellucid_lab.arm.wearer import DONNING_POSTURE_RAD, HANDLE_AT, Person, drawn_people, worn_arguments
from pellucid_lab.arm.worn_trial import run
from pellucid_lab.known_rigs import parse_rig
from pellucid_lab.shipped_rigs import shipped_rig
from pellucid_lab.study import record_in_memory, study_config
from pellucid_lab.study_text import study_text


class Carried:
    """A law that gives the weight of the robot as it was built, and nothing else."""

    def __init__(self, rig):
        self.weight = rig.built.core.gravity

    def reset(self):
        self.heard = []

    def step(self, time, position, wrench):
        self.heard.append(wrench)
        return self.weight(position)


class Nothing:
    """A law that lets the wearer carry it all."""

    def reset(self):
        pass

    def step(self, time, position, wrench):
        return np.zeros(4)


def short(rig, seconds=2.0):
    """A path within the limits."""
    limits, rate = limits_of(rig), rig["sampling"]["rate"]
    time = np.arange(round(seconds * rate)) / rate
    middle = 0.5 * (limits.low + limits.high)
    path = middle + 0.3 * (1.0 - np.cos(2.0 * np.pi * time / seconds))[:, None] * np.array([0.5, -0.5, 1.0, 1.0])
    return ArmTrial("short", reference=path, slider=rig["slider"]["clamped"])


@pytest.fixture(scope="module")
def rig():
    return able_arm()


def test_the_built_arm_is_nearly_the_drawn_one(rig):
    built, drawn = rig.built, rig.drawing
    assert rig.robot.names == JOINTS
    rng = np.random.default_rng(1)
    q = rng.uniform(-0.2, 1.5, (50, 4))
    at, meant = (tree.core.placements(q)[:, 3, :, 3] for tree in (built, drawn))
    off = np.linalg.norm(at - meant, axis=1)
    assert 2e-4 < off.max() < 5e-3
    # A body that a drawing knows too little of weighs less, and hangs elsewhere.
    share = np.abs(drawn.core.gravity(q)).max() / np.abs(rig.gravity(q)).max()
    assert 0.75 < share < 1.0
    # Positive is as named: an arm that is lifted is higher, to the front, to the right, and turned inwards.
    hand = np.array([0.0, 0.0, -0.2])

    def hand_at(*angles):
        frame = drawn.core.placements(np.array(angles))[3]
        return frame[:, :3] @ hand + frame[:, 3]

    hanging = hand_at(0.0, 0.0, 0.0, 0.0)
    assert hand_at(0.0, 1.0, 0.0, 0.0)[0] > hanging[0] + 0.3
    assert hand_at(1.0, 0.0, 0.0, 0.0)[1] < hanging[1] - 0.3
    assert hand_at(0.0, 0.0, 0.0, 1.5)[0] > hanging[0] + 0.15
    assert hand_at(0.0, 0.0, 0.5, 1.5)[1] > hand_at(0.0, 0.0, 0.0, 1.5)[1] + 0.05
    assert rig.gravity(np.array([0.8, 0.0, 0.0, 0.3]))[0] > 3.0


def test_bodies_are_bodies_in_every_drawn_arm(rig):
    for arm in (rig, *drawn_arms(rig, 4)):
        for tree in (arm.built, arm.drawing):
            for link in tree.links:
                mass, *rest = link.numbers
                h, (xx, xy, xz, yy, yz, zz) = np.array(rest[:3]), rest[3:]
                inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
                about = 0.5 * np.trace(inertia) * np.eye(3) - inertia
                pseudo = np.block([[about, h[:, None]], [h[None], np.array([[mass]])]])
                assert np.linalg.eigvalsh(pseudo).min() > 0.0, (arm.name, link.name)
    assert len(BODY_QUANTITIES) == 10
    first, again = drawn_arms(rig, 2), drawn_arms(rig, 2)
    assert [a.tables for a in first] == [a.tables for a in again]
    assert first[0].tables != first[1].tables


def test_what_is_recorded_hangs_on_its_seed_alone(rig):
    trial = short(rig)
    taken = [rig.record(trial, np.random.default_rng(seed)) for seed in (1, 1, 2)]
    values = [one.files["short"]["main"].values for one in taken]
    np.testing.assert_array_equal(values[0], values[1])
    assert np.any(values[0] != values[2])
    # Encoders sit on motors, behind springs; loops follow; nothing is at its limit.
    inside = taken[0].inside
    assert np.abs(inside["position"] - trial.reference).max() < 0.5
    read = values[0][:, 1:5] * rig.quanta
    assert 1e-3 < np.abs(read - inside["position"]).max() < 0.05
    assert np.abs(inside["command"]).max() < 0.9 * min(rig["joint"][name]["current_limit"] for name in JOINTS)


def test_the_protocol_keeps_to_its_limits_and_is_drawn_by_its_seed(rig):
    quick = rig.changed({"protocol.repetitions": 1, "protocol.duration": 10.0})
    trials = quick.trials(3)
    assert {t.use for t in trials} == {"fit", "validate"}
    assert len({t.name for t in trials}) == len(trials)
    said = [rig["joint"][name] for name in JOINTS]
    for trial in trials:
        assert np.all(trial.reference > [s["low"] for s in said])
        assert np.all(trial.reference < [s["high"] for s in said])
    again, other = quick.trials(3), quick.trials(4)
    np.testing.assert_array_equal(trials[0].reference, again[0].reference)
    assert np.any(trials[0].reference[:1000] != other[0].reference[:1000])
    assert json.loads(json.dumps(rig.truth(1)))["names"] == list(JOINTS)


def test_cuffs_are_closed_without_force_where_they_were_put_on(rig):
    person = drawn_people(1)[0]
    tree = built_tree(rig.constants, rotors=False)
    given = worn_arguments(person, tree, 1e-3)
    plant = rig.plant(**given)
    plant.reset(np.append(DONNING_POSTURE_RAD, HANDLE_AT * person.forearm), np.array(DONNING_POSTURE_RAD))
    *_, pull = plant.run(np.zeros(5))
    assert np.abs(pull[:, :3]).max() < 1e-9
    # Axes that miss each other by a centimetre pull elsewhere.
    plant.reset(np.array([0.9, 1.2, 0.6, 0.5, 0.2]), np.array([0.9, 1.2, 0.6, 0.5]))
    *_, pull = plant.run(np.zeros(5))
    assert np.abs(pull[:, :3]).max() > 5.0


def test_a_robot_that_is_carried_costs_less_than_one_that_hangs_on_the_arm(rig):
    person = Person("one", offset=(0.01, -0.008, 0.01))
    motion = generated_motion(2, rig["sampling"]["rate"], 5.0)
    carried, hung = (run(rig, person, law, motion) for law in (Carried(rig), Nothing()))
    again = run(rig, person, Carried(rig), motion)
    np.testing.assert_array_equal(carried.on_limb, again.on_limb)
    assert not carried.stopped
    assert carried.interaction_rms < 0.5 * hung.interaction_rms
    assert np.all(carried.error < hung.error)
    # The wearer works against friction; the handle's sensor reads the cuff.
    assert carried.work > 0.0
    noise = carried.wrench - carried.pull
    assert 0.1 < np.std(noise[..., :3]) < 0.2
    # What cuffs do at the robot's joints is what they do at the arm's, but for where the axes are.
    size = np.sqrt(np.mean(carried.on_limb**2))
    assert np.sqrt(np.mean((carried.on_limb + carried.on_robot) ** 2)) < 0.5 * size


def test_a_free_shoulder_that_is_kept_still_changes_little_at_the_elbow(rig):
    person = Person("one", offset=(0.01, -0.008, 0.01))
    slider = HANDLE_AT * person.forearm
    constants = elbow_constants(rig, slider)
    # Gravity of the whole forearm, with its carriage there, and dry friction of the size of the rig's.
    forearm = rig["link"]["elbow_flexion"]["mass"] * 0.105 + rig["link"]["carriage"]["mass"] * slider
    assert constants.pooled[0] == pytest.approx(9.81 * forearm, rel=0.06)
    assert constants.up[0] > constants.down[0]
    assert 0.1 < constants.up[2] < 0.6
    whole = pointing(rig["sampling"]["rate"])
    motion = replace(whole, position=whole.position[:4500])
    found = {}
    for held in (True, False):
        law = ElbowAndShoulder(rig, LAWS["clpc"](rig, constants), held=held)
        found[held] = figures_of(run(rig, person, law, motion), "clpc", "held" if held else "free")
    assert not found[True].stopped
    assert found[False].elbow_interaction == pytest.approx(found[True].elbow_interaction, rel=0.15)
    assert found[False].shoulder_peak < 0.1


def built_card(rig):
    """Of the robot's own numbers, without friction."""
    estimate = SimpleNamespace(
        name="built", method="known", robot=rig.robot, families=((),) * 4,
        links=lambda: rig.drawing.links_array, joints=lambda: np.zeros((4, len(JOINT_NUMBERS))),
    )  # fmt: skip
    return card_of(rig, estimate)


def test_force_sensors_in_cuffs_are_taken_to_the_joints(rig):
    """With the robot's own numbers on a card, feedback of what both cuffs feel leaves less than the weight alone."""
    card = built_card(rig)
    person = Person("one")
    points = sensor_points(person)
    heard = CardLaw(with_force_sensor(carried(card), proportional=2.0, lowpass=15.0), points)
    q = np.array([0.4, 0.6, 0.2, 1.1])
    force = np.array([1.0, -2.0, 3.0])
    frame, jacobian = card.tree.placements(q)[3], card.tree.jacobian(q, 3, np.array(points[1]))
    pulled = np.zeros((2, 6))
    pulled[1, :3] = frame[:, :3].T @ force
    felt = {}

    class Listening:
        def step(self, time, position, interaction):
            felt["at_joints"] = interaction
            return np.zeros(4)

    heard.running = Listening()
    heard.step(0.0, q, pulled)
    np.testing.assert_allclose(felt["at_joints"], jacobian[:3].T @ force, atol=1e-12)
    motion = generated_motion(4, rig["sampling"]["rate"], 3.0)
    weight = run(rig, person, CardLaw(carried(card)), motion)
    sensed = run(rig, person, CardLaw(heard.law, points), motion)
    assert not sensed.stopped
    assert sensed.interaction_rms < 0.6 * weight.interaction_rms


def test_its_study_is_one_of_several_joints(rig):
    quick = rig.changed({"protocol.repetitions": 1, "protocol.duration": 10.0})
    trials = [t for t in quick.trials(1) if t.protocol == "fourier"]
    config, recordings, made = record_in_memory(quick, trials, seed=1)
    assert tuple(joint.name for joint in config.rig.joints) == JOINTS
    assert config.tree is not None
    text = study_text({**quick.study(made), "name": "arm"}, quick.comments)
    assert text.count("[[rig.joints]]") == 4
    assert study_config(tomllib.loads(text)).rig == config.rig
    assert [r.use for r in recordings] == ["fit", "validate"]
    assert recordings[0]["current.elbow_flexion"].std() > 0.1


def test_what_lacks_is_named():
    text = shipped_rig("able-arm")
    with pytest.raises(StudyError, match=r"\[joint.flexion\] lacks stiffness"):
        parse_rig(text.replace("stiffness = 1600.0\n", ""), "mine")
    with pytest.raises(StudyError, match=r"\[assembly\] lacks tilt"):
        parse_rig(text.replace("tilt = [0.003, -0.004]", ""), "mine")


def test_single_faults_stop_a_worn_arm(rig):
    """A drive that is dead is found by its measurement at once, without only by where the arm goes."""
    card, person = built_card(rig), Person("one")
    law, measured = carried(card), carried(card, instruments=Instruments(drive=True))
    motion, short = generated_motion(4, rig["sampling"]["rate"], 2.0), {"onset": 0.8, "watched": 0.5}
    faults = ("encoder_nan", "drive_dead", "encoder_flipped", "force_lost")
    tried = list(fault_trials(rig, person, measured, motion, faults=faults, **short))
    assert [trial.fault for trial in tried] == ["encoder_nan", "drive_dead", "encoder_flipped"]
    nan, dead, mirrored = tried
    assert (nan.joint, nan.said, nan.found) == (0, "not_finite", 0.0)
    assert (dead.joint, mirrored.said) == (1, "none")
    assert 0.0 < dead.found < 0.01
    assert dead.peak > dead.healthy_peak
    both = carried(card, instruments=Instruments(drive=True, joint_encoder=True))
    longer = generated_motion(4, rig["sampling"]["rate"], 5.0)
    watched = {"onset": 0.8, "watched": 4.0, "first": 3}
    (mirrored,) = fault_trials(rig, person, both, longer, faults=("encoder_flipped",), **watched)
    assert mirrored.said == "disagreement"
    assert mirrored.safe_excess <= mirrored.excess
    # Energy and time of the worst of each group: encoder, drive, and an encoder that lies beside a second one.
    assert max(one.safe_excess for one in (nan, dead, mirrored)) < 1e-3
    assert mirrored.found < 1.5
    (blind,) = fault_trials(rig, person, law, motion, faults=("drive_dead",), first=1, **short)
    assert not blind.found < 0.1
