"""The same people by another model: who they are, what they do without a robot, and what outlasts a movement."""

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import StudyError
from pellucid_lab.pointing.people import draw_people, parameter_names, person_model
from pellucid_lab.pointing.rig import elbow_people
from pellucid_lab.pointing.session import Unpowered, simulate_session

RIG = elbow_people().modelled("optimal")


def test_they_are_the_same_people():
    assert person_model(RIG) == "optimal"
    person = draw_people(RIG, np.random.default_rng(3))[0]
    other = draw_people(elbow_people(), np.random.default_rng(3))[0]
    assert (person.mass, person.height, person.reward, person.emg_gains) == (
        other.mass,
        other.height,
        other.reward,
        other.emg_gains,
    )
    assert dict(person.drawn).items() >= dict(other.drawn).items()
    vector = dict(zip(parameter_names(RIG), person.vector(RIG), strict=True))
    own = dict(person.drawn)
    assert vector["phasic_noise_share"] == own["phasic_noise_share"]
    assert vector["stiffness_per_torque"] == own["stiffness_per_torque"]
    assert vector["tolerance"] == own["tolerance_share"] * RIG["pointing"]["tolerance"]
    with pytest.raises(StudyError, match="expected one of"):
        elbow_people().modelled("optimum")


def test_without_a_robot_people_arrive_and_hold():
    rng = np.random.default_rng(4)
    for person in draw_people(RIG, rng)[:3]:
        session = simulate_session(RIG, person, "Ctrl", None, rng, np.deg2rad([12, 60]))
        assert all(m.held for m in session.movements)
        for m in session.movements:
            hold = session.signals["position"][m.end - 1900 : m.end]
            assert np.abs(hold - m.target).max() < RIG["pointing"]["tolerance"]
            # 1.76 of the mean speed over the 0.88 of the duration in which they move.
            speed = np.abs(session.signals["velocity"][m.begin : m.end]).max()
            assert speed == pytest.approx(2.0 * abs(m.amplitude) / m.duration, rel=0.3)
        assert session.signals["extensor"].min() > 0.0


def test_in_a_robot_they_step():
    rng = np.random.default_rng(5)
    session = simulate_session(RIG, draw_people(RIG, rng)[0], "off", Unpowered(), rng, np.deg2rad([24]))
    assert all(np.isfinite(signal).all() for signal in session.signals.values())


def test_the_core_says_what_outlasts_a_movement():
    person = draw_people(RIG, np.random.default_rng(8))[0]
    arm = _core.WornElbow(person.vector(RIG), np.zeros(5), position0=1.0, strap=RIG.strap, drive=[1, 1, 0, 0, 0],
                          emg_gains=[1, 1], substeps=4, person="optimal")  # fmt: skip
    own = dict(person.drawn)
    assert arm.lasting["uncertainty"] == pytest.approx(own["uncertainty"])
    assert arm.lasting["cocontraction"] == pytest.approx(own["cocontraction"])
    assert arm.lasting["stiffness"] > own["resting_stiffness"]
