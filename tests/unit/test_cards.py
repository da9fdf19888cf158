"""The library of identified machines, and the actuators that simulators get of a card."""

import importlib.util
import json
import sys
import types

import mujoco
import numpy as np
import pytest

import pellucid
from pellucid._errors import PellucidError
from pellucid.controllers.export.actuator_folder import QUANTITIES, actuators_of
from pellucid.models.cards import FOLDER

NAMES = ("dynamixel-xl330", "emps", "staubli-tx40", "sydney-pendulum", "ur10e")


def test_the_library_has_every_card_with_its_source():
    assert pellucid.cards.names() == NAMES
    for name in NAMES:
        card = pellucid.cards.load(name)
        assert card.parameters
        assert card.source.startswith("https://github.com/")
        assert card.citation
        assert card.licence
        assert name in card.command
        assert card.card.study.replace("_", "-") in name or name.startswith(("dynamixel", "staubli"))
        assert (FOLDER / f"{name}.json").stat().st_size < 120_000


def test_a_card_has_parameters_with_intervals_and_says_what_to_cite():
    card = pellucid.cards.load("emps")
    low, high = card["inertia"].interval
    assert low < 95.1089 < high  # as published
    assert card["inertia"].unit == "kg"
    assert "Janot" in str(card)


def test_another_name_is_refused_with_the_names_there_are():
    with pytest.raises(PellucidError, match="dynamixel-xl330"):
        pellucid.cards.load("xl330")


def test_the_known_load_is_not_part_of_the_armature():
    card = pellucid.cards.load("dynamixel-xl330")
    (joint,) = actuators_of(card.card, load_inertia=card.load_inertia).joints
    armature = joint.quantities["armature"]
    assert armature.value == pytest.approx(card["inertia"].value - 0.0049)
    assert armature.low < 0.001814 < armature.high  # as its authors identified it
    assert set(joint.quantities) == {"armature", *QUANTITIES}
    assert all(0.0 <= r.low <= r.value <= r.high for r in joint.quantities.values())


@pytest.mark.parametrize("name", ["dynamixel-xl330", "emps", "staubli-tx40", "ur10e"])
def test_every_card_with_known_torque_gives_actuators_of_each_joint(name, tmp_path):
    folder = pellucid.export(pellucid.cards.load(name), "mjx", tmp_path / "a")
    table = json.loads((folder / "actuators.json").read_text())
    assert len(table["joints"]) == (6 if name in ("staubli-tx40", "ur10e") else 1)
    for numbers in table["joints"].values():
        assert numbers["frictionloss"]["high"] > 0.0
        assert numbers["armature"]["low"] <= numbers["armature"]["value"] <= numbers["armature"]["high"]


def test_volts_are_refused_and_so_is_a_controller(tmp_path):
    with pytest.raises(PellucidError, match="torque_constant"):
        pellucid.export(pellucid.cards.load("sydney-pendulum"), "isaaclab", tmp_path)
    with pytest.raises(PellucidError, match='"mjx"'):
        pellucid.export(pellucid.cards.load("emps"), "c", tmp_path)


def program(folder, name):
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


ROBOT = """<mujoco><worldbody><body><joint name="servo" type="hinge"/><geom size="0.1" mass="1"/></body></worldbody>
</mujoco>"""


def test_a_model_of_mujoco_takes_the_numbers(tmp_path):
    folder = pellucid.export(pellucid.cards.load("dynamixel-xl330"), "mjx", tmp_path / "a")
    made = program(folder, "mjx_actuators").set_actuators(mujoco.MjModel.from_xml_string(ROBOT))
    numbers = json.loads((folder / "actuators.json").read_text())["joints"]["servo"]
    assert made.dof_armature[0] == numbers["armature"]["value"]
    assert np.ravel(made.dof_damping)[0] == numbers["damping"]["value"]


def test_mjx_draws_from_the_ranges_and_adds_load_friction(tmp_path):
    jax = pytest.importorskip("jax", reason="jax and mujoco-mjx are not installed")
    mjx = pytest.importorskip("mujoco.mjx", reason="jax and mujoco-mjx are not installed")
    folder = pellucid.export(pellucid.cards.load("dynamixel-xl330"), "mjx", tmp_path / "a")
    actuators = program(folder, "mjx_actuators")
    plain = actuators.set_actuators(mujoco.MjModel.from_xml_string(ROBOT))
    model = mjx.put_model(plain)
    batch, axes = actuators.domain_randomize(plain, model, jax.random.split(jax.random.PRNGKey(1), 50))
    armature = json.loads((folder / "actuators.json").read_text())["joints"]["servo"]["armature"]
    drawn = np.asarray(batch.dof_armature)
    assert drawn.shape == (50, 1)
    assert drawn.min() >= armature["low"] * 0.999
    assert drawn.max() <= armature["high"] * 1.001
    assert np.ptp(drawn) > 0.5 * (armature["high"] - armature["low"])
    assert axes.dof_armature == 0
    data = mjx.make_data(model).replace(qvel=jax.numpy.ones(1), qfrc_applied=jax.numpy.array([0.5]))
    changed = actuators.with_load_friction(plain, model, data)
    assert changed.dof_frictionloss[0] > model.dof_frictionloss[0]


class StandIn(types.SimpleNamespace):
    """A configuration of Isaac Lab: it keeps what it is given."""

    def __init__(self, *names, **values):
        super().__init__(names=names, **values)


def test_isaac_lab_gets_actuators_and_events(tmp_path, monkeypatch):
    modules = {
        "isaaclab": types.ModuleType("isaaclab"),
        "isaaclab.actuators": types.SimpleNamespace(ImplicitActuatorCfg=StandIn),
        "isaaclab.envs": types.ModuleType("isaaclab.envs"),
        "isaaclab.envs.mdp": types.SimpleNamespace(randomize_joint_parameters="randomize"),
        "isaaclab.managers": types.SimpleNamespace(EventTermCfg=StandIn, SceneEntityCfg=StandIn),
    }
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(modules["isaaclab.envs"], "mdp", modules["isaaclab.envs.mdp"], raising=False)
    monkeypatch.setattr(modules["isaaclab"], "envs", modules["isaaclab.envs"], raising=False)
    folder = pellucid.export(pellucid.cards.load("ur10e"), "isaaclab", tmp_path / "a")
    made = program(folder, "isaaclab_actuators")
    actuators, events = made.actuators(stiffness=20.0), made.randomization()
    assert len(actuators) == len(events) == 6
    name = next(iter(actuators))
    assert actuators[name].joint_names_expr == [name]
    assert actuators[name].friction > 0.0
    numbers = json.loads((folder / "actuators.json").read_text())["joints"][name]
    # Isaac Lab applies one draw to static, dynamic and viscous friction: only a scale suits all three.
    assert events[name].params["operation"] == "scale"
    for parameter, key, value in (
        ("friction_distribution_params", "frictionloss", actuators[name].dynamic_friction),
        ("armature_distribution_params", "armature", actuators[name].armature),
    ):
        low, high = events[name].params[parameter]
        assert 0.0 <= low * value <= value <= high * value
        assert (low * value, high * value) == pytest.approx((numbers[key]["low"], numbers[key]["high"]))
