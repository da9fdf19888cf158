"""Loads and support: what a law carries, what its supervisor expects, what is exported, and the load of one lift."""

import numpy as np
import pytest
from test_elbow_laws import COHERENT, LIMB, PLACE, POOLED
from test_export_elbow import study  # noqa: F401

from pellucid._errors import IdentificationError, PellucidError
from pellucid.controllers.control_law import JOINT_LAW, LAWS, TRANSPARENT_LAW, ControlLaw
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.elbow_laws import position_control
from pellucid.controllers.export.elbow_values import elbow_values
from pellucid.controllers.supervised import body_of, supervised
from pellucid.controllers.transparent_laws import expecting_load, transparent, with_load, with_rules, with_support
from pellucid.joint.fit.drive_constant import Lift, estimate_load
from pellucid.models.anthropometry import point_mass
from pellucid.models.joint import GRAVITY
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.pointing.session import simulate_session

KILOGRAM_LOAD = point_mass(1.0, 0.3)


def test_a_load_on_the_robot_is_carried_and_expected():
    plain = transparent(COHERENT, PLACE)
    law = with_load(plain, KILOGRAM_LOAD)
    assert law.values["gravity_sine"] == pytest.approx(plain.values["gravity_sine"] + GRAVITY * 0.3)
    assert law.values["inertia"] == pytest.approx(plain.values["inertia"] + 0.09)
    stated = supervised(law, body=body_of(plain)).supervision
    own = supervised(law).supervision
    for name in ("body_inertia", "body_gravity_sine"):
        assert stated[name] == pytest.approx(own[name])
        assert own[name] > supervised(plain).supervision[name]


def test_rules_learnt_beyond_the_body_leave_a_law_its_load():
    law = with_support(with_load(transparent(COHERENT, PLACE), KILOGRAM_LOAD), LIMB, 0.3)
    ruled = with_rules(law, {})
    assert (ruled.load, ruled.supported, ruled.uses) == (law.load, law.supported, law.uses)


def test_a_known_load_leaves_the_force_sensor_little_to_contradict_and_an_unknown_one_more():
    plain = ELBOW_CONTROLLERS["force_sensor"].build(COHERENT, PLACE)
    tolerances = [
        supervised(law).supervision["force_tolerance"]
        for law in (plain, with_load(plain, KILOGRAM_LOAD), expecting_load(plain, KILOGRAM_LOAD))
    ]
    assert tolerances[0] < tolerances[1] < tolerances[0] + 0.15 * KILOGRAM_LOAD.gravity()
    assert tolerances[2] > tolerances[0] + KILOGRAM_LOAD.gravity()
    assert tolerances[1] < KILOGRAM_LOAD.gravity()  # a load of 1 kg that falls contradicts more than that


def test_support_is_the_weight_alone_and_no_part_of_the_robot():
    plain = transparent(COHERENT, PLACE)
    law = with_support(plain, LIMB, 0.5)
    assert law.supported == pytest.approx(0.5 * LIMB.gravity())
    assert law.values["gravity_sine"] == pytest.approx(plain.values["gravity_sine"] + law.supported)
    assert law.values["inertia"] == plain.values["inertia"]
    assert body_of(law)["gravity_sine"] == pytest.approx(body_of(plain)["gravity_sine"])
    both = with_support(law, KILOGRAM_LOAD)
    assert both.supported == pytest.approx(law.supported + KILOGRAM_LOAD.gravity())
    now, then = (supervised(x).supervision for x in (law, plain))
    assert now["wearer_torque"] > then["wearer_torque"]
    assert now["budget_store"] > then["budget_store"]


def test_what_cannot_carry_a_load_says_so():
    with pytest.raises(PellucidError, match="found a law without gravity compensation, expected one for a load"):
        with_load(position_control(POOLED, PLACE), KILOGRAM_LOAD)
    with pytest.raises(PellucidError, match="expected one for support"):
        with_support(ELBOW_CONTROLLERS["zero_impedance"].build(COHERENT, PLACE), LIMB)
    with pytest.raises(PellucidError, match="found a load already"):
        with_load(with_load(transparent(COHERENT, PLACE), KILOGRAM_LOAD), KILOGRAM_LOAD)
    with pytest.raises(PellucidError, match=r"found a share of 1\.5, expected 0 to 1"):
        with_support(transparent(COHERENT, PLACE), LIMB, 1.5)
    with pytest.raises(PellucidError, match="found no limb, expected the wearer's"):
        ELBOW_CONTROLLERS["support"].build(COHERENT, PLACE)


@pytest.mark.parametrize("name", [name for name in ELBOW_CONTROLLERS if name != "dithered"])
def test_a_controller_says_whether_it_carries_a_load(name):
    from test_elbow_laws import BOTH

    controller = ELBOW_CONTROLLERS[name]
    card = {"pooled": POOLED, "dissociated": BOTH, "load": COHERENT}[controller.method]
    settings = {"limb": LIMB} if controller.wearer else {}
    settings |= {"exponents": (-1.0, -1.9)} if controller.exponents else {}
    if controller.carries_load:
        assert controller.build(card, PLACE, load=KILOGRAM_LOAD, **settings).load == KILOGRAM_LOAD
    else:
        with pytest.raises(PellucidError, match="found a law without gravity compensation"):
            controller.build(card, PLACE, load=KILOGRAM_LOAD, **settings)


def test_a_body_joined_with_another_has_the_weight_and_inertia_of_both():
    both = LIMB.joined(KILOGRAM_LOAD)
    assert both.gravity() == pytest.approx(LIMB.gravity() + KILOGRAM_LOAD.gravity())
    assert both.inertia == pytest.approx(LIMB.inertia + KILOGRAM_LOAD.inertia)
    assert both.mass == pytest.approx(LIMB.mass + 1.0)


def test_laws_without_a_load_have_the_numbers_that_they_had():
    for law in (transparent(COHERENT, PLACE), ControlLaw("joint", JOINT_LAW.defaults | {"gravity_sine": 1.0})):
        assert law.load is None
        assert law.supported == law.unstated == 0.0
        assert body_of(law)["gravity_sine"] == law.values["gravity_sine"]
    assert TRANSPARENT_LAW.name in LAWS


def test_the_wearer_leans_on_the_robot_with_what_it_supports():
    rig = elbow_participants()
    person = draw_people(rig, np.random.default_rng(1), count=6)[0]
    from pellucid_lab.pointing.conditions import identify_cards

    card, place = identify_cards(rig.robot)["load"], person.slider(rig)
    pressed = {}
    for share in (0.0, 0.4):
        law = ELBOW_CONTROLLERS["support"].build(card, place, limb=person.forearm, share=share)
        session = simulate_session(rig, person, "worn", law, np.random.default_rng(2), np.deg2rad([36.0]))
        assert session.fault == "none"
        pressed[share] = session.signals["interaction"].mean(), session.signals["flexor"].mean()
    meant = 0.4 * person.forearm.gravity()
    assert pressed[0.4][0] - pressed[0.0][0] == pytest.approx(-meant, rel=0.25)
    assert pressed[0.4][1] < 0.9 * pressed[0.0][1]


def test_an_exported_law_carries_the_load_and_tells_of_it(study):  # noqa: F811
    plain = elbow_values(study, "force_sensor")
    values = elbow_values(study, "force_sensor", load=(1.0, 0.3), held=(0.5, 0.3))
    more = values.numbers["gravity_sine"] - plain.numbers["gravity_sine"]
    assert more == pytest.approx(1.5 * 0.3 * GRAVITY)
    assert "of it from loads" in values.remarks["gravity_sine"]
    notes = " ".join(values.notes)
    assert "a load of 1 kg at 0.3 m that is fastened to the robot" in notes
    assert "No sensor of the robot detects that this weight is gone" in notes
    was, now = plain.supervised.supervision["body_gravity_sine"], values.supervised.supervision["body_gravity_sine"]
    assert now - was == pytest.approx(0.3 * GRAVITY)
    with pytest.raises(PellucidError, match=r"found a load of -1 kg at 0\.3 m, expected both above 0"):
        elbow_values(study, "force_sensor", load=(-1.0, 0.3))


def lift(mass, error=0.0, wearer=0.0):
    """A lift of a robot without friction; a wearer gives a share of the load."""
    t = np.arange(0.0, 1.5, 1e-3)
    q = 0.3 + 0.8 * (t / 1.5) ** 2 * (3.0 - 2.0 * t / 1.5)
    a = 0.8 * (6.0 - 12.0 * t / 1.5) / 1.5**2
    given = wearer * mass * (GRAVITY * 0.3 * np.sin(q) + 0.09 * a)
    effort = (2.0 + error + GRAVITY * 0.3 * mass) * np.sin(q) + (0.05 + 0.09 * mass) * a - given
    return Lift(q, effort, given, 1000.0)


EMPTY_LIFTS = [lift(0.0, error) for error in (-0.02, 0.01, 0.04)]
ROBOT_BODY = {"inertia": 0.05, "gravity_sine": 2.0}


@pytest.mark.parametrize("wearer", [0.0, 0.5, 1.0])
def test_one_lift_tells_the_load_whoever_lifts_it(wearer):
    found = estimate_load(ROBOT_BODY, EMPTY_LIFTS, lift(1.2, 0.01, wearer), distance=0.3)
    assert found.mass == pytest.approx(1.2, abs=0.01)
    assert found.interval[0] < 1.2 < found.interval[1]
    assert found.load.inertia == pytest.approx(found.mass * 0.09)


def test_an_uncertain_gain_of_the_force_sensor_widens_the_interval():
    narrow, wide = (
        estimate_load(ROBOT_BODY, EMPTY_LIFTS, lift(1.2, 0.0, 1.0), distance=0.3, gain_error=share).interval
        for share in (0.0, 0.05)
    )
    assert wide[1] - wide[0] > 2.0 * 0.05 * 1.2
    assert wide[0] < narrow[0] < narrow[1] < wide[1]


def test_what_tells_no_load_is_refused():
    with pytest.raises(IdentificationError, match="found 2 lifts without load, expected at least 3"):
        estimate_load(ROBOT_BODY, EMPTY_LIFTS[:2], lift(1.0), distance=0.3)
    with pytest.raises(IdentificationError, match="found a distance of 0 m"):
        estimate_load(ROBOT_BODY, EMPTY_LIFTS, lift(1.0), distance=0.0)
    still = Lift(np.full(500, 1.0), np.ones(500), np.zeros(500), 1000.0)
    with pytest.raises(IdentificationError, match=r"found 0 s of motion above 0\.1 rad/s"):
        estimate_load(ROBOT_BODY, EMPTY_LIFTS, still, distance=0.3)
    with pytest.raises(IdentificationError, match="found mass in the body, expected any of inertia"):
        estimate_load({"mass": 1.0}, EMPTY_LIFTS, lift(1.0), distance=0.3)
