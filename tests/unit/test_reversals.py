"""Over what way friction builds up, from slow motions that turn round."""

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.joint.slider.slider_fit import TRAVEL_SEARCH, find_turns, presliding_travel
from pellucid.joint.slider.study.identify_slider import travel_of
from pellucid_lab.elbow.protocol import trials
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.pointing.conditions import build_study_conditions, identify_cards, offered_controller
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.study import record_in_memory

FS = 200.0


def recording(travel, rng, noise=0.02, periods=4):
    """A slow motion to and fro with gravity, a level that differs by direction, and noise."""
    t = np.arange(round(20 * periods * FS)) / FS
    q = 0.15 * np.cos(2 * np.pi * t / 20)
    s = _core.presliding(travel, q)
    effort = 1.2 + 0.8 * q + np.where(s > 0, 0.5, 0.4) * s + 0.1 * np.gradient(q) * FS
    return q, effort + noise * rng.standard_normal(len(t)), FS


def test_turns_are_found_and_the_first_is_left_out():
    t = np.arange(8000) / FS
    found = find_turns(0.15 * np.cos(2 * np.pi * t / 10))
    assert [round(turn / FS) for _, turn, _ in found] == [10, 15, 20, 25, 30, 35]
    assert find_turns(0.4 * TRAVEL_SEARCH.turn_band_rad * np.cos(t)) == []


@pytest.mark.parametrize("travel", [3e-4, 1e-3, 3e-3])
def test_a_travel_is_found(travel, rng):
    found = presliding_travel([recording(travel, rng)])
    assert found.value == pytest.approx(travel, rel=0.1)
    assert found.interval()[0] < travel < found.interval()[1]


def test_too_few_turns_say_nothing(rng):
    assert presliding_travel([recording(1e-3, rng, periods=2)]) is None
    assert presliding_travel([]) is None


@pytest.mark.parametrize("travel", [0.0, 1e-3])
def test_the_virtual_elbow_shows_it(travel):
    """Through its loop, its encoder, its current sensor, a cable and a gap: none is found to be next to none."""
    robot = able_elbow().changed({"transmission.presliding_travel": travel})
    made = tuple(t for t in trials(robot) if t.protocol == "reversals")
    config, recordings, _ = record_in_memory(robot, made, seed=11)
    found = travel_of(config, recordings)
    assert found.value == pytest.approx(travel, rel=0.1, abs=5e-5)


def test_a_robot_that_gives_too_much_is_offered_no_dither():
    robot = able_elbow().changed({"transmission.presliding_travel": 1e-3})
    cards = identify_cards(robot)
    assert {method: card.presliding_travel.value for method, card in cards.items()} == pytest.approx(
        dict.fromkeys(cards, 1e-3), rel=0.1
    )
    assert offered_controller(cards, "dithered") == "transparent"
    assert offered_controller(cards, "force_sensor") == "force_sensor"
    with pytest.raises(PellucidError, match=r"expected at most 0.5 for dither"):
        build_study_conditions(elbow_participants(robot), ["dithered"])
