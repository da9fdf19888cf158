"""Laws compared with virtual people: control as published, our own laws, energy, what would slow people."""

import numpy as np
import pytest

from pellucid.controllers.elbow_controllers import BEST_CONTROLLER, BEST_SENSED_CONTROLLER
from pellucid.controllers.transparent_laws import with_force_sensor
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.papers.able.transparency import VirtualStudy, content_on_target, required_resistance, simulate_study
from pellucid_lab.pointing.conditions import controller_builder, identify_cards, interaction_rms, published_conditions
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.pointing.session import simulate_sessions, standstill_speed
from pellucid_lab.pointing.session_indices import FIRST_REST_RULE, PUBLISHED_RULE, injected_energy, session_indices

LIFTS = np.deg2rad([12, 24, 36, 48, 60])


@pytest.fixture(scope="module")
def cards():
    return identify_cards(able_elbow())


def sessions(rig, people, laws, seed):
    jobs = [
        (rig, person, name, make and make(person, person.slider(rig)), rng, LIFTS)
        for name, make in laws.items()
        for person, rng in zip(people, np.random.default_rng(seed).spawn(len(people)), strict=True)
    ]
    return simulate_sessions(jobs, threads=2)


@pytest.mark.parametrize("seed", [1, 2])
def test_without_a_robot_people_are_as_quick_as_those_of_the_paper(seed):
    rng, rig = np.random.default_rng(seed), elbow_participants()
    people = draw_people(rig, rng)
    lifts = np.deg2rad(np.repeat([12, 24, 36, 48, 60], 4))
    made = simulate_sessions(
        [(rig, p, "Ctrl", None, g, lifts) for p, g in zip(people, rng.spawn(6), strict=True)], threads=2
    )
    study = VirtualStudy(seed, tuple(session_indices(s) for s in made))
    assert study.values("duration", "Ctrl").mean() == pytest.approx(0.957, rel=0.05)
    assert study.values("vmax", "Ctrl").mean() == pytest.approx(1.416, rel=0.05)
    assert study.values("up", "Ctrl").mean() > 0.9


def test_a_force_sensor_leaves_far_less_torque_and_nothing_drives(cards):
    rig = elbow_participants()
    people = draw_people(rig, np.random.default_rng(21), count=2)
    laws = {"Ctrl": None, "FC": published_conditions(cards, (0.0, -0.5))["FC"]}
    laws |= {
        "best": controller_builder(cards, BEST_CONTROLLER),
        "best_sensed": controller_builder(cards, BEST_SENSED_CONTROLLER),
    }
    made = sessions(rig, people, laws, 3)
    torque = {
        name: np.mean([interaction_rms(s) for s in made if s.condition == name]) for name in laws if name != "Ctrl"
    }
    energy = {name: np.concatenate([injected_energy(s) for s in made if s.condition == name]).mean() for name in torque}
    assert torque["best_sensed"] < 0.7 * torque["FC"]  # 0.54 and 0.58 on a drawn robot
    assert torque["best"] < torque["FC"]
    assert energy["best"] < 0.0
    assert energy["best_sensed"] < 0.0
    assert energy["FC"] > energy["best"]
    study = VirtualStudy(3, tuple(session_indices(s) for s in made))
    assert abs(study.change("duration", "best_sensed")) < 15.0
    assert study.conditions == ("Ctrl", "FC", "best", "best_sensed")
    assert all(s.fault == "none" for s in made)


def test_a_loop_without_margin_is_found_to_cycle_or_stopped(cards):
    rig = elbow_participants()
    person = draw_people(rig, np.random.default_rng(21), count=1)[0]
    law = controller_builder(cards, BEST_SENSED_CONTROLLER)(person, person.slider(rig))
    assert standstill_speed(rig, person, law) == 0.0
    assert standstill_speed(rig, person, with_force_sensor(law, proportional=8.0)) > 0.1


def test_a_strap_that_hangs_loose_at_rest_is_no_lost_sensor(cards):
    rig = elbow_participants().strapped({"slack": 0.02})
    person = draw_people(rig, np.random.default_rng(21), count=1)[0]
    assert (
        standstill_speed(rig, person, controller_builder(cards, BEST_SENSED_CONTROLLER)(person, person.slider(rig)))
        == 0.0
    )


def test_what_would_slow_people_by_a_fifth():
    rig = elbow_participants()
    people = draw_people(rig, np.random.default_rng(2))
    needed = required_resistance(rig, people)
    assert 0.01 < needed["inertia"] < 0.1
    assert 0.1 < needed["viscous"] < 1.0
    half = required_resistance(rig, people, 0.1)
    assert half["inertia"] < needed["inertia"]


def test_a_study_keeps_what_its_sessions_came_to(cards):
    few = elbow_participants().changed({"pointing.repetitions": 1, "people.count": 2})
    conditions = {"Ctrl": None, "CLPC": published_conditions(cards, (0.0, -0.5))["CLPC"]}
    study = simulate_study(few, conditions, seed=4)
    assert study.conditions == ("Ctrl", "CLPC")
    assert [t.movements for t in study.taken] == [10] * 4
    assert study.change("duration", "Ctrl") == 0.0
    # Corrections at the target come after the first rest.
    for condition in study.conditions:
        longer, shorter = (study.values("duration", condition, rule) for rule in (PUBLISHED_RULE, FIRST_REST_RULE))
        assert np.all(longer >= shorter)
    content = simulate_study(content_on_target(few), conditions, seed=4)
    assert content_on_target(few)["vision"]["tolerance"] == few["pointing"]["tolerance"]
    assert content.values("duration", "CLPC").mean() < study.values("duration", "CLPC").mean()
