"""People who hold as well as reach: who is drawn, what they do without a robot, and what the core says of them."""

from importlib.resources import files

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import StudyError
from pellucid_lab.known_rigs import load_rig
from pellucid_lab.pointing.people import draw_people, parameter_names, person_model
from pellucid_lab.pointing.rig import PeopleRig, elbow_participants, elbow_people
from pellucid_lab.pointing.session import Unpowered, simulate_session

RIG = elbow_people()
TEXT = (files("pellucid_lab") / "rigs" / "elbow-people.toml").read_text(encoding="utf-8")


def test_the_rig_is_one_of_the_package_and_its_people_wear_the_same_robot():
    assert isinstance(load_rig("elbow-people"), PeopleRig)
    assert person_model(RIG) == "postural"
    assert person_model(elbow_participants()) == "reaching"
    assert RIG["robot"] == elbow_participants()["robot"]


def test_nobody_knows_the_condition():
    values = [line.split("#")[0] for line in TEXT.splitlines()]
    assert not any(name in line for line in values for name in ("FC", "CLPC", "Ctrl", "condition"))


def test_people_differ_as_the_file_says():
    people = draw_people(RIG, np.random.default_rng(1), count=200)
    for name, table in (("posture_stiffness", "impedance"), ("reflex_delay", "muscles"), ("patience", "vision")):
        logs = np.log([dict(one.drawn)[name] for one in people])
        assert np.median(logs) == pytest.approx(np.log(RIG[table][name]), abs=0.01)
        assert logs.std(ddof=1) == pytest.approx(RIG[table][f"{name}_spread"], rel=0.01)
    vector = dict(zip(parameter_names(RIG), people[0].vector(RIG), strict=True))
    own = dict(people[0].drawn)
    assert vector["posture_stiffness"] == own["posture_stiffness"]
    assert vector["visual_delay"] == own["delay"]
    assert vector["tolerance"] == own["tolerance_share"] * RIG["pointing"]["tolerance"]


def test_without_a_robot_people_arrive_and_hold():
    rng = np.random.default_rng(4)
    for person in draw_people(RIG, rng)[:3]:
        session = simulate_session(RIG, person, "Ctrl", None, rng, np.deg2rad([12, 60]))
        assert all(m.held for m in session.movements)
        for m in session.movements:
            hold = session.signals["position"][m.end - 1900 : m.end]
            assert np.abs(hold - m.target).max() < RIG["pointing"]["tolerance"]
        efforts = [m.lasting["effort"] for m in session.movements]
        assert np.all(np.diff(efforts) > 0.0)
        assert not any(m.lasting["given_up"] for m in session.movements)
        # Antagonists have what both always have, while nothing goes wrong.
        assert session.signals["extensor"].min() >= 0.9 * dict(person.drawn)["cocontraction"]


def test_in_a_robot_they_step():
    rng = np.random.default_rng(5)
    session = simulate_session(RIG, draw_people(RIG, rng)[0], "off", Unpowered(), rng, np.deg2rad([24]))
    assert all(np.isfinite(signal).all() for signal in session.signals.values())


def stuck(model: str, parameters: np.ndarray) -> tuple[_core.WornElbow, tuple[np.ndarray, ...]]:
    arm = _core.WornElbow(
        parameters, np.zeros(5), position0=1.0, strap=RIG.strap, drive=[1, 1, 0, 0, 0], emg_gains=[1, 1], substeps=4,
        person=model,
    )  # fmt: skip
    # A target that the plan falls far short of, and a dead zone that nothing gets into.
    moved = arm.move(target=1.4, amplitude=0.1, duration=0.5, reaction=0.1, load=np.zeros(5), tolerance=0.0, hold=1.0,
                     noise=np.zeros((10, 5)), longest=3000)  # fmt: skip
    return arm, moved


def test_the_core_says_what_outlasts_a_movement():
    person = draw_people(RIG, np.random.default_rng(8))[0]
    arm, _ = stuck("postural", person.vector(RIG))
    said = arm.lasting
    assert said["corrections"] >= 1
    assert said["effort"] > 0.0
    assert 0.0 < said["extensor_fatigue"] < said["flexor_fatigue"] < 0.01
    assert not said["given_up"]
    rig = elbow_participants()
    assert stuck("reaching", draw_people(rig, np.random.default_rng(8))[0].vector(rig))[0].lasting == {}


def test_the_core_refuses_a_model_that_it_does_not_have():
    vector = draw_people(RIG, np.random.default_rng(8))[0].vector(RIG)
    with pytest.raises(ValueError, match='person: found "posture", expected one of reaching, postural'):
        stuck("posture", vector)
    with pytest.raises(ValueError, match="parameters"):
        stuck("reaching", vector)


def test_a_file_that_lacks_something_is_told():
    with pytest.raises(StudyError, match=r"model: found 'posture', expected one of reaching, postural"):
        PeopleRig.parse(TEXT.replace('model = "postural"', 'model = "posture"'), "x")
    with pytest.raises(StudyError, match=r'model = "reaching" lacks stiffness, damping'):
        PeopleRig.parse(TEXT.replace('model = "postural"', 'model = "reaching"'), "x")
    with pytest.raises(StudyError, match=r"\[impedance\] lacks posture_stiffness"):
        PeopleRig.parse(TEXT.replace("\nposture_stiffness = ", "\nstiffness = "), "x")
