"""A robot's card: what was written is read to the bit, and what no robot can be is refused by name."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.arm.fit.friction_terms import FRICTION_COEFFICIENTS
from pellucid.models.card import CardParameter
from pellucid.models.tree_card import JointRange, Ripple, TreeCard, read_tree_card, write_tree_card


def card_of_two():
    """Two hinges, the second's motor turning with both."""
    links = np.zeros((2, len(_core.LINK_PARAMETER_NAMES)))
    links[:, 1], links[:, 9], links[:, 12] = 1.0, 1.0, 2.0
    links[:, [16, 19, 21]] = 0.1 / 3.0
    links[1, [0, 2]] = 1.0, 0.4
    joints = np.zeros((2, len(_core.TREE_JOINT_PARAMETER_NAMES)))
    joints[:, 1:5] = 0.7
    joints[:, _core.TREE_JOINT_PARAMETER_NAMES.index("velocity_width")] = 0.02
    return TreeCard(
        study="two", family="best", method="weighted least squares", names=("shoulder", "elbow"),
        bodies=("upper", "lower"), links=tuple(map(tuple, links.tolist())), gravity=(0.0, 0.0, -9.81),
        joints=tuple(map(tuple, joints.tolist())), turns=((1.0, 0.0), (1.0, 1.0)),
        motors=((0.0,) * len(_core.TREE_MOTOR_PARAMETER_NAMES),) * 2, gains=(11.5, -3.2), gains_known=(True, False),
        drive_units=("A", "A"), effort_units=("N*m", "A"),
        ranges=(JointRange(-1.0, 2.0, seen_velocity=3.0), JointRange()),
        families=(("coulomb", "viscous"), ("coulomb",)), consistent=True,
        parameters=(CardParameter("shoulder.viscous", "N*m*s/rad", 0.7, 0.1, (0.5, 0.9)),), covariance=((0.01,),),
        heldout_error=(4.0, None), processing="low-pass", confidence=0.95, notes=("a [ 'note' ]",),
        checksums={"one": "0" * 64}, pellucid="0",
        ripples=(Ripple("elbow", 30.6, 0.5, 0.1),), known={"payload.mass": 2.8},
    )  # fmt: skip


def test_a_card_is_read_as_it_was_written(tmp_path):
    path = write_tree_card(tmp_path / "tree.best.json", card_of_two())
    assert read_tree_card(path) == card_of_two()
    table = json.loads(path.read_text())
    assert table["joints"][1]["coulomb_positive"] == 0.7
    assert table["links"][1]["parent"] == 1


def test_a_card_alone_gives_efforts():
    card = card_of_two()
    still, moving = (card.driven(1e-3).motor_effort(np.zeros(2), v * np.ones(2), np.zeros(2)) for v in (0.0, 1.0))
    np.testing.assert_allclose((moving - still) @ np.array(card.turns), 1.4)
    assert card.motion == "rr"
    np.testing.assert_array_equal(card.velocity_width, [0.02, 0.02])


def test_a_number_that_a_file_lacks_is_the_cores_default(tmp_path):
    path = write_tree_card(tmp_path / "tree.json", card_of_two())
    table = json.loads(path.read_text())
    del table["joints"][0]["presliding_travel"]
    path.write_text(json.dumps(table))
    assert read_tree_card(path).joints == card_of_two().joints


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        ("kind", "slider", "not the model card of a robot of several joints"),
        ("names", ["shoulder"], "names: found 1 entries, expected 2"),
        ("names", ["shoulder", "shoulder"], "names: found 'shoulder', expected a name, each once"),
        ("links.1.parent", 2, "links: link 2: parent"),
        ("links.1.mass", "x", r"links\[1\].mass: found 'x', expected a number"),
        ("links.1.mas", 1.0, r"links\[1\]: found the unknown key 'mas'"),
        ("joints.0.coulomb_positive", -1.0, r"joints\[0\].coulomb_positive: found -1, expected 0 to"),
        ("joints.0.load_motoring", 1e300, r"joints\[0\].load_motoring: found 1e\+300"),
        ("turns", [[1.0, 0.0], [1.0, 0.0]], "turns"),
        ("turns", [[1.0, 0.0], [1.0]], "turns: expected rows of 2 numbers"),
        ("gains.0", 0.0, "gains: found 0 of shoulder"),
        ("drive_units.0", "furlong", "found the unit 'furlong'"),
        ("ranges.0.high", -2.0, "ranges: shoulder: found -1 to -2"),
        ("ripples.0.joint", "hip", "ripples: found the joint 'hip'"),
        ("covariance", [[-1.0]], "expected that of a covariance"),
    ],
)
def test_what_no_robot_can_be_is_refused_by_name(tmp_path, at, value, message):
    path = write_tree_card(tmp_path / "tree.json", card_of_two())
    table = json.loads(path.read_text())
    *parts, key = at.split(".")
    node = table
    for part in parts:
        node = node[int(part) if isinstance(node, list) else part]
    node[int(key) if isinstance(node, list) else key] = value
    path.write_text(json.dumps(table))
    with pytest.raises(PellucidError, match=message):
        read_tree_card(path)


def test_units_of_every_friction_term_are_read(tmp_path):
    """A unit that no reader knows would make a card of its joint unreadable."""
    card = card_of_two()
    for number in FRICTION_COEFFICIENTS.values():
        for unit in number.unit:
            with_it = replace(card, parameters=(replace(card.parameters[0], unit=unit),))
            assert read_tree_card(write_tree_card(tmp_path / "tree.json", with_it)) == with_it
