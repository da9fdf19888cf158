"""The test at start-up: exported laws start from every posture, and a wrong polarity or gain is still found."""

import math

import numpy as np
import pytest
from simulated_joint import BODY, FRICTION, SimulatedJoint, changed, identified, live

import pellucid as pl
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.instruments import Instruments
from pellucid.models.anthropometry import forearm
from pellucid.models.card import CardParameter
from pellucid.models.joint import PARAMETER_FIELDS
from pellucid.models.slider_joint import SliderCard

SCALES = ((1.0, 1.0, 1.0), (0.8, 0.8, 0.8), (1.25, 1.25, 1.25), (0.8, 1.25, 1.25), (1.25, 0.8, 0.8))
"""Factors of inertia, gravity and friction by which a robot may differ from its card."""

JOINTS = {
    "bench": {
        "inertia": 0.085, "gravity_sine": 3.1, "offset": 0.05, "coulomb_positive": 0.5, "coulomb_negative": 0.5,
        "viscous_positive": 0.23, "viscous_negative": 0.23,
    },
    "servo": {
        "inertia": 0.005, "gravity_sine": 0.6, "coulomb_positive": 0.09, "coulomb_negative": 0.09,
        "viscous_positive": 0.05, "viscous_negative": 0.05,
    },
    "pendulum": {
        "inertia": 0.24, "gravity_sine": 16.6, "coulomb_positive": 0.02, "coulomb_negative": 0.02,
        "viscous_positive": 0.05, "viscous_negative": 0.05,
    },
    "horizontal": {**BODY, "gravity_sine": 0.0, "viscous_positive": 0.5, "viscous_negative": 0.5},
    "geared": {
        "inertia": 0.02, "gravity_sine": 1.0, "coulomb_positive": 1.5, "coulomb_negative": 1.5,
        "viscous_positive": 2.0, "viscous_negative": 2.0,
    },
    "heavy": {
        "inertia": 95.0, "gravity_sine": 0.0, "coulomb_positive": 20.0, "coulomb_negative": 20.0,
        "viscous_positive": 40.0, "viscous_negative": 40.0,
    },
    "root": BODY | FRICTION["root"],
}  # fmt: skip
POSTURES = np.linspace(-1.5, 1.5, 6)


@pytest.fixture(scope="module", params=JOINTS)
def exported(request):
    """A joint and its default export: its compensation with the limits that the card suggests."""
    body = JOINTS[request.param]
    noise = 0.01 * (body["gravity_sine"] + body["coulomb_positive"])
    return body, pl.supervised(pl.controller(identified(body, "root" if "square_root" in body else "symmetric", noise)))


def starts(body, law, **held):
    """Where it was, by which factors it differed, and what came out, of every start."""
    # Where its own friction just holds it, too.
    rests = 0.7 * body["coulomb_positive"] / max(body["gravity_sine"], body["coulomb_positive"])
    for place in (*POSTURES, 0.0, -rests, rests):
        for scales in SCALES:
            robot = changed(body, *scales)
            joint = SimulatedJoint(robot, float(place), **held)
            if held or joint.can_rest():
                yield float(place), scales, live(law, joint, 0.5 + 2e-3 * law.supervision["test_samples"])[:2]


def test_it_starts_wherever_a_hand_holds_it(exported):
    body, law = exported
    stiff = max(200.0 * body["inertia"], 7.0 * body["gravity_sine"])
    for held in ({"hold": stiff}, {"hold": stiff, "arm": body["inertia"]}):
        wrong = [made for made in starts(body, law, **held) if made[2] != ("none", "running")]
        assert wrong == []


def test_it_starts_wherever_friction_holds_it(exported):
    body, law = exported
    made = list(starts(body, law))
    assert made
    assert [one for one in made if one[2] != ("none", "running")] == []


def test_wrong_polarity_is_found_and_a_dead_drive_too(exported):
    body, law = exported
    if law.supervision["test_effort"] == 0.0:
        pytest.skip("the limit of effort cannot move the joint: there is no test")
    for place in POSTURES:
        for gain in (-1.0, 0.0):
            joint = SimulatedJoint(body, float(place), hold=max(200.0 * body["inertia"], 7.0 * body["gravity_sine"]))
            joint.gain = gain
            assert live(law, joint, 1.0)[0] == "polarity", (place, gain)
            assert joint.reached < 0.05


def test_a_wrong_gain_is_found_beside_the_work_at_commissioning(exported):
    body, law = exported
    if law.supervision["test_effort"] == 0.0:
        pytest.skip("the limit of effort cannot move the joint: there is no test")
    joint = SimulatedJoint(body, 0.0, gain=4.5)
    assert live(law, joint, 12.0)[0] in ("gain", "overspeed")  # three waves, each after the joint has come to rest


def test_there_is_a_test_where_the_limit_of_effort_allows_one(exported):
    body, law = exported
    friction = law.supervision["body_coulomb"] + law.supervision["body_load"] * body["gravity_sine"]
    assert (law.supervision["test_effort"] > 0.0) == (law.values["effort_limit"] > friction / 0.7)


def test_no_wave_is_smaller_than_the_encoder_tells():
    law = pl.controller(identified(BODY, "symmetric"))
    blind = pl.supervised(law, instruments=Instruments(encoder_resolution=1.0))
    assert blind.supervision["test_effort"] == 0.0
    assert live(blind, SimulatedJoint(BODY, 0.0), 0.3)[:2] == ("none", "running")


def test_a_wearer_may_let_it_swing_before_it_starts():
    """Nothing is given while it waits for rest: what falls spends no energy of the drive's."""
    law = pl.supervised(pl.controller(identified(BODY, "symmetric"), limits=pl.Limits(5.0, 500.0, 12.0, (-2.0, 2.0))))
    assert live(law, SimulatedJoint(BODY, 1.2), 6.0)[:2] == ("none", "running")


def test_less_than_the_weight_may_be_carried():
    """A limit of effort below the weight: the wearer carries the rest, and is no fault."""
    law = pl.supervised(pl.controller(identified(BODY, "symmetric"), limits=pl.Limits(0.7, 70.0, 8.0, (-2.0, 2.0))))
    assert live(law, SimulatedJoint(BODY, 1.2, hold=20.0), 3.0)[:2] == ("none", "running")


def test_pushing_with_the_weight_is_found_while_the_law_carries_it():
    """An effort within its limit that goes the way the weight does pushes a wearer harder than the limit."""
    law = pl.supervised(pl.controller(identified(BODY, "symmetric"), limits=pl.Limits(5.0, 500.0, 8.0, (-2.0, 2.0))),
                        start_up=False, wearer_torque=math.inf, wearer_push=math.inf,
                        body_gravity_sine=-8.0)  # fmt: skip
    assert live(law, SimulatedJoint(BODY, 1.2, hold=50.0), 1.0)[0] == "push"


ONE_WAY = {
    "moment_slope": 0.48, "moment": 0.12, "cross_moment": 0.026, "coulomb": 0.25, "viscous": 0.05,
    "a0": 0.032, "a1": -0.009, "a2": 0.48,
}  # fmt: skip
ELBOW = {
    "pooled": ONE_WAY,
    "dissociated": {f"{name}_{way}": value for way in ("up", "down") for name, value in ONE_WAY.items()},
    "load": {
        "inertia": 0.032, "carriage_moment": -0.0045, "gravity": 1.15, "gravity_cosine": 0.26,
        "coulomb_positive": 0.26, "coulomb_negative": 0.21, "viscous_positive": 0.05, "viscous_negative": 0.04,
        "load_motoring": 0.13, "load_generating": 0.11,
    },
}  # fmt: skip


def elbow_card(method):
    return SliderCard(
        study="bench", family=method, method="", motion="rotary", effort_unit="N*m", lifts="flexion",
        parameters=tuple(CardParameter(n, "1", v, 0.0, (v, v)) for n, v in ELBOW[method].items()), covariance=(),
        known={"carriage_mass": 0.48} if method == "load" else {}, rail=(0.12, 0.27), drive={"gain": 1.0},
        heldout_error=None, residual_sd=0.0, processing="", confidence=0.95, notes=(), checksums={}, pellucid="0",
        presliding_travel=CardParameter("presliding_travel", "rad", 3e-4, 2e-5, (2.6e-4, 3.4e-4)),
    )  # fmt: skip


@pytest.mark.parametrize("name", ["compensation", *ELBOW_CONTROLLERS])
def test_an_elbow_controller_starts_wherever_it_is_held(name):
    """Over the whole range, in a hand and with an arm in it, on robots that are a little other than the card."""
    plain = pl.controller(elbow_card("load"), slider=0.195)
    law = plain
    if name != "compensation":
        named = ELBOW_CONTROLLERS[name]
        limb = {"limb": forearm(63.0, 1.75)} if named.wearer else {}
        law = named.build(elbow_card(named.method), 0.195, **limb)
    law = pl.supervised(law)
    body = {key: plain.values[key] for key in PARAMETER_FIELDS if key != "velocity_width"}
    wrong = []
    for place in np.linspace(0.02, 2.2, 5):
        for scales in ((0.8, 1.25, 1.25), (1.25, 0.8, 0.8)):
            for arm in (0.0, 0.06):
                joint = SimulatedJoint(changed(body, *scales), float(place), hold=30.0, arm=arm)
                found = live(law, joint, 0.5, resolution=1e-4)[:2]
                wrong += [(place, scales, arm, *found)] if found != ("none", "running") else []
    assert wrong == []
