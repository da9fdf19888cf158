"""Where friction changes its sign: by the filtered velocity, a sharper direction, or over a travel."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid import _core
from pellucid.joint.fit.friction_solver import solve_family
from pellucid.joint.fit.slip_direction import DirectionChoice, choose_direction
from pellucid.models.joint import joint_model
from pellucid.numerics.motion import Filtering, JudgedDataInFitError, motion_of, with_friction_direction
from pellucid.numerics.regression import stack

RATE_HZ = 500.0
TRUTH = {"inertia": 0.1, "gravity": 2.0, "viscous": 0.15, "coulomb": 0.5}
MODEL = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine")


def recorded(travel=0.0, noise=0.0, counts=0):
    """A motion whose acceleration jumps by what friction jumps, as a joint that slips under a steady command.

    Its encoder has so many `counts` a turn; the effort has `noise` [N*m].
    """
    rng = np.random.default_rng(11)
    t = np.arange(0.0, 30.0, 1.0 / RATE_HZ)
    smooth = sum(a * w * np.cos(w * t + p) for a, w, p in ((0.5, 1.1, 0.3), (0.2, 4.3, 1.0), (0.05, 9.0, 2.0)))
    v = smooth - 0.15 * np.tanh(smooth / 0.1)
    q = np.cumsum(v) / RATE_HZ
    friction = _core.presliding(travel, q) if travel else np.sign(v)
    a = np.gradient(v, 1.0 / RATE_HZ)
    effort = TRUTH["inertia"] * a + TRUTH["gravity"] * np.sin(q) + TRUTH["viscous"] * v + TRUTH["coulomb"] * friction
    effort += noise * rng.standard_normal(len(t))
    read = q if not counts else np.round(q * counts / (2.0 * np.pi)) * 2.0 * np.pi / counts
    return motion_of(t, read, effort, Filtering(8.0, 4, 10, 0.02, 100))


def errors(motion):
    found = dict(zip(MODEL.names, solve_family(MODEL, stack([motion])).values, strict=True))
    return {name: abs(found[name] / value - 1.0) for name, value in TRUTH.items()}


def test_a_travel_takes_the_error_from_friction_and_weight():
    motion = recorded(travel=4e-3, noise=0.005)
    choice = choose_direction([MODEL], [motion], 0.05)
    assert 2e-3 < choice.travel < 8e-3
    before, after = errors(motion), errors(choice.apply(motion))
    assert after["coulomb"] < 0.5 * before["coulomb"]
    assert after["viscous"] < 0.5 * before["viscous"]


def test_noise_that_hides_the_turns_leaves_the_sign_of_the_velocity():
    choice = choose_direction([MODEL], [recorded(noise=1.0)], 0.05)
    assert (choice.share, choice.travel) == (1.0, 0.0)


def test_a_coarse_encoder_shows_no_travel_below_its_steps():
    choice = choose_direction([MODEL], [recorded(travel=4e-3, noise=0.005, counts=300)], 0.05)
    assert choice.travel == 0.0 or choice.travel > 2.0 * np.pi / 300


def test_the_chosen_direction_reaches_motions_that_are_made_of_arrays():
    motion = with_friction_direction(recorded(), share=4.0)
    again = motion_of(motion.time, motion.raw_position, motion.command, motion.filtering)
    assert again.slip_velocity == pytest.approx(motion.slip_velocity)
    assert np.abs(motion.slip_velocity) == pytest.approx(np.maximum(np.abs(motion.velocity), 1e-9))
    bent = with_friction_direction(motion, travel=1e-3)
    assert np.abs(bent.direction).max() <= 1.0
    assert bent.slip_velocity is None


def test_rows_and_effort_agree_with_a_sharper_direction():
    motion = with_friction_direction(recorded(), share=4.0)
    for family in ("directional", "combined"):
        model = joint_model(family, motion="rotary", effort_unit="N*m", gravity="sine")
        values = np.linspace(0.1, 0.4, len(model.names))
        effort, jacobian = model.jacobian(values, motion)
        rows, slopes = model.rows(values, motion)
        assert model.effort(values, motion) == pytest.approx(effort, abs=1e-9)
        assert rows == pytest.approx(motion.rows(effort), abs=1e-9)
        assert slopes == pytest.approx(motion.rows(jacobian), abs=1e-9)


@pytest.mark.parametrize("separate_load", [False, True])
def test_rows_follow_every_value(separate_load):
    motion = recorded()
    model = joint_model(
        "combined", motion="rotary", effort_unit="N*m", gravity="sine", separate_load=separate_load, velocity_range=3.0
    )
    first = np.linspace(0.1, 0.4, len(model.names))
    for i in range(len(first)):
        values = np.where(np.arange(len(first)) == i, 1.3 * first, first)
        effort, jacobian = model.jacobian(values, motion)
        rows, slopes = model.rows(values, motion)
        assert rows == pytest.approx(motion.rows(effort), abs=1e-9)
        assert slopes == pytest.approx(motion.rows(jacobian), abs=1e-9)


def test_motions_without_a_recorded_position_keep_the_sign_of_their_velocity():
    motion = replace(recorded(), raw_position=None)
    assert choose_direction([MODEL], [motion], 0.05) == DirectionChoice()
    assert with_friction_direction(motion, share=4.0) is motion


def test_held_out_motions_are_refused():
    held = motion_of(
        *(getattr(recorded(), n) for n in ("time", "raw_position", "command", "filtering")), split="heldout"
    )
    with pytest.raises(JudgedDataInFitError):
        choose_direction([MODEL], [held], 0.05)
