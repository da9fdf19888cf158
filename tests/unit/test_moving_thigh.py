"""A walking wearer: what a moving thigh adds, against kinematics in the world's axes, and a walk in the lab."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid.controllers.coupling import Coupling
from pellucid.models.joint import GRAVITY
from pellucid_lab.knee.moving_thigh import (
    LawWithFootSwitch,
    LawWithThighSensor,
    MovingThigh,
    ThighSensor,
    from_gait,
    generated_gait,
    thigh_trial,
    walking_thigh,
)
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.knee.trial import run_trial

STEP_S = 1e-4


def second(signal):
    return np.gradient(np.gradient(signal, STEP_S), STEP_S)


def moving():
    """A thigh, a knee and a flexion that move smoothly, and the place of the knee."""
    t = np.arange(0.0, 1.0, STEP_S)
    lean = 0.3 * np.sin(5.0 * t) + 0.1
    knee = np.array([0.2 * np.sin(4.0 * t + 1.0), 0.05 * np.cos(7.0 * t)])
    flexion = 0.6 + 0.4 * np.sin(6.0 * t + 0.5)
    still = np.zeros(len(t))
    thigh = MovingThigh("made", "made", flexion, lean, second(lean), second(knee[0]), second(knee[1]), still, still)
    return thigh, knee


def test_what_a_thigh_adds_is_that_of_newton_in_the_worlds_axes():
    thigh, knee = moving()
    mass, along, across, inertia = 3.0, 0.25, 0.04, 0.25
    back = thigh.flexion - thigh.lean
    # A body at `along` down the shank and `across` in front of it; leaning back turns it backwards.
    place = knee + np.array([
        -along * np.sin(back) + across * np.cos(back) * -1.0,
        -along * np.cos(back) + across * np.sin(back),
    ])  # fmt: skip
    force = mass * (np.array([second(place[0]), second(place[1])]) + np.array([[0.0], [GRAVITY]]))
    arm = place - knee
    about_centre = inertia - mass * (along**2 + across**2)
    # Turning back is clockwise where forward is to the right: the moment of a force is negative of the plane's own.
    needed = about_centre * second(back) - (arm[0] * force[1] - arm[1] * force[0])
    sine, cosine = mass * GRAVITY * along, mass * GRAVITY * across
    added = thigh.added_torque(slice(None), thigh.flexion, sine, cosine, inertia)
    own = inertia * second(thigh.flexion) + sine * np.sin(thigh.flexion) + cosine * np.cos(thigh.flexion)
    inside = slice(20, -20)
    np.testing.assert_allclose((own - added)[inside], needed[inside], atol=1e-4 * np.abs(needed).max())


def test_a_thigh_at_rest_adds_nothing():
    n = np.zeros(5)
    thigh = MovingThigh("rest", "made", n, n, n, n, n, n, n)
    assert thigh.added_torque(2, 0.7, 3.0, 0.4, 0.2) == pytest.approx(0.0, abs=1e-12)


def test_a_pace_makes_strides_quicker_and_the_ground_is_absent_while_the_foot_swings(rng):
    gait = generated_gait(100.0, 8.0, rng, 1.0)
    slow, quick = (from_gait(gait, "generated", 200.0, 6.0, np.random.default_rng(1), pace) for pace in (1.0, 1.5))
    assert np.std(quick.forward) > 1.5 * np.std(slow.forward)
    assert np.all(slow.ground[slow.bearing == 0.0] == 0.0)
    assert 0.2 < np.mean(slow.bearing[400:] > 0.5) < 0.8
    assert slow.flexion[0] == pytest.approx(np.mean(slow.flexion), abs=0.15)


def test_a_wearer_walks_and_the_orthosis_obeys_newton_on_the_moving_thigh(monkeypatch, tmp_path):
    monkeypatch.setenv("PELLUCID_DATA", str(tmp_path))
    rig = knee_orthosis()
    subject = next(iter(rig.subjects.values()))
    thigh = walking_thigh(1.0 / rig.period, 5.0, np.random.default_rng(2))
    assert thigh.source == "generated"
    taken = run_trial(rig, thigh_trial("walk", subject, thigh, rig), rng=np.random.default_rng(3))
    truth, body = taken.truth, (*rig.orthosis_gravity, rig.constants.orthosis.inertia)
    assert np.std(truth.limb_position - thigh.flexion) < 0.5 * np.std(thigh.flexion)
    angle = truth.orthosis_position
    added = thigh.added_torque(slice(None), angle, *body)
    weight = body[0] * np.sin(angle) + body[1] * np.cos(angle)
    needed = body[2] * np.gradient(truth.orthosis_velocity, rig.period) + weight - added
    left = (needed - truth.spring_torque - truth.strap_torque)[1000:-10]
    assert np.std(left) < 0.15 < 0.3 * np.std(added[1000:])


def test_a_sensor_on_the_thigh_tells_what_it_adds():
    thigh, _ = moving()
    still = StillGravity()
    coupling = Coupling(
        orthosis_inertia=0.05, orthosis_viscous=0.1, orthosis_gravity=1.6, coulomb=0.1, limb_inertia=0.3,
        limb_viscous=0.1, limb_gravity=10.0, strap_stiffness=100.0, strap_damping=2.0, actuator_frequency=60.0,
    )  # fmt: skip
    law = LawWithThighSensor(still, coupling, thigh, STEP_S, ThighSensor(angle_error=0.0, lowpass=400.0))
    for k in (2000, 5000, 8000):
        angle = float(thigh.flexion[k])
        added = float(thigh.added_torque(k, angle, 1.6, 0.0, 0.05))
        assert law.step(k * STEP_S, angle, 0.0) == pytest.approx(1.6 * np.sin(angle) - added, abs=0.02)
        assert still.felt == pytest.approx(added, abs=0.02)
    assert law.fault == "none"


def test_a_switch_under_the_foot_scales_a_command_in_stance_alone_and_a_little_late():
    moved, _ = moving()
    seconds = STEP_S * np.arange(len(moved.bearing))
    thigh = replace(moved, bearing=((seconds > 0.3) & (seconds < 0.7)).astype(float))
    law = LawWithFootSwitch(StillGravity(), thigh, STEP_S, 0.5)
    told = np.array([law.step(k * STEP_S, 1.0, 0.0) for k in range(len(thigh.bearing))]) / (1.6 * np.sin(1.0))
    switched = np.diff((thigh.bearing > 0.1).astype(int))
    closes, opens = (1 + np.flatnonzero(switched == way)[-1] for way in (1, -1))
    late = round(0.02 / STEP_S)
    assert told[closes + late - 1] == pytest.approx(1.0, abs=0.02)
    assert told[closes + late + round(0.15 / STEP_S)] == pytest.approx(0.5, abs=0.02)
    assert told[opens + late - 1] == pytest.approx(0.5, abs=0.02)
    assert told.min() >= 0.5
    assert told.max() <= 1.0
    assert law.fault == "none"


class StillGravity:
    """A law that carries an orthosis's weight as on a thigh at rest."""

    fault = "none"

    def step(self, time, position, torque, emg=()):
        self.felt = torque
        return 1.6 * np.sin(position)
