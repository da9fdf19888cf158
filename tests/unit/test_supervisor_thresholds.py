"""Every threshold of the supervisors as a number: which share of which limit it is, for laws that differ in one way."""

import math
from dataclasses import replace

import numpy as np
import pytest
from test_tree_laws import arm, with_joint_numbers

from pellucid._errors import PellucidError
from pellucid.controllers import joint_compensation, tree_laws
from pellucid.controllers import supervised as rules
from pellucid.controllers.control_law import LAWS, ControlLaw, Limits
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.supervised import PROBE_ANSWER_NAMES, StartUpWave, body_of, start_up_wave, supervised
from pellucid.controllers.worn import watched_worn
from pellucid.models.anthropometry import Segment
from pellucid.models.card import CardParameter, ModelCard
from pellucid.models.slider_joint import SliderCard
from pellucid.models.tree_card import COLUMNS, JointRange

EFFORT, SPEED, INERTIA, PERIOD = 5.0, 10.0, 0.05, 1e-3
WEIGHT = 1.5 + 0.25
LEVEL, LOAD, VISCOUS, ROOT = 0.3 + 0.1, 0.1, 0.08, 0.04
REST = LEVEL + LOAD * WEIGHT  # friction at rest under the whole weight
NUMBERS = {
    "inertia": INERTIA, "gravity_sine": 1.2, "gravity_cosine": 0.9, "offset": -0.25, "velocity_width": 0.1,
    "coulomb_positive": 0.3, "coulomb_negative": 0.2, "stribeck": 0.1, "stribeck_velocity": 0.2,
    "viscous_positive": 0.05, "viscous_negative": VISCOUS, "load_motoring": LOAD, "load_generating": 0.06,
    "square_root": ROOT, "effort_limit": EFFORT, "rate_limit": 500.0, "velocity_limit": SPEED, "position_min": -2.0,
    "position_max": 1.5, "stop_margin": 0.1, "max_age": 0.005, "max_repeats": 2.0, "period": PERIOD,
}  # fmt: skip


def joint(**changes):
    return ControlLaw("joint", LAWS["joint"].defaults | NUMBERS | changes)


def thresholds(law=None, **settings):
    return dict(supervised(joint() if law is None else law, **settings).supervision)


def resisted(speed):
    return REST + VISCOUS * speed + ROOT * math.sqrt(speed)


def half_wave(effort, samples, friction, inertia, period=PERIOD, change=math.inf):
    """Work and travel of half a wave against friction, from rest."""
    pushed, speed, work, travel = 0.0, 0.0, 0.0, 0.0
    for phase in np.pi * np.arange(1, samples + 1) / samples:
        pushed += float(np.clip(effort * np.sin(phase) - pushed, -change, change))
        speed = max(0.0, speed + (pushed - friction) * period / inertia)
        work, travel = work + pushed * speed * period, travel + speed * period
    return work, travel


def test_every_threshold_of_a_joint():
    wave = REST + 50.0 * INERTIA
    work, travel = half_wave(wave, 32, REST / 0.7, INERTIA)
    assert travel > 4.0 * 4e-4
    expected = {
        "raw_speed_limit": SPEED, "raw_acceleration_limit": EFFORT / (0.1 * INERTIA), "range_min": -2.15,
        "range_max": 1.65, "encoder_resolution": 4e-4, "freeze_speed": 0.9, "freeze_samples": 20.0,
        "joint_expected": 0.0, "joint_tolerance": 0.05, "body_inertia": INERTIA, "body_gravity_sine": 1.2,
        "body_gravity_cosine": 0.9, "body_offset": -0.25, "body_coulomb": LEVEL, "body_load": LOAD,
        "body_viscous": VISCOUS, "body_square_root": ROOT, "body_width": 0.1, "residual_bandwidth": 40.0,
        "residual_slow": 5.0, "wearer_torque": 27.0 * INERTIA + 0.4 * WEIGHT, "wearer_push": INERTIA * SPEED / 0.065,
        "force_tolerance": 0.33 + 0.4 * WEIGHT, "force_burst": 4.0 + 0.4 * WEIGHT,
        "force_excess": 0.11 + 0.4 * WEIGHT, "force_expected": 0.0,
        "force_range": math.inf, "force_quiet_samples": 50.0, "muscle_expected": 0.0, "muscle_range": 40.0,
        "muscle_quiet_samples": 50.0, "drive_expected": 0.0, "drive_cycles": 4.0, "drive_tolerance": 0.25,
        "drive_share": 0.15, "drive_limit": math.inf, "drive_surplus": 0.025, "drive_late": math.exp(-1.0 / 4.5),
        "drive_inertia": 0.0, "drive_answer": 1.0,
        "drive_gain": 0.05,
        "drive_offset": 0.05, "drive_forget": 1.0 - math.exp(-1e-4), "push_limit": EFFORT,
        "power_limit": resisted(SPEED) * SPEED + WEIGHT * SPEED, "budget_store": INERTIA * 5.75**2,
        "budget_power": 0.5, "ringing_limit": 0.69, "ringing_slowest": 20.0, "ringing_fastest": 100.0,
        "ringing_memory": 3.0, "hold_damping": 2.5, "hold_limit": 1.5 * WEIGHT + REST, "test_effort": wave,
        "test_samples": 32.0, "test_rest": 100.0, "test_least": 0.1 * work,
        "test_most": 2.5 * 2.0 * (wave * 0.032 / math.pi) ** 2 / INERTIA, "degrades": 1.0, "moving_speed": 0.2,
        "rest_speed": 0.3, "reset_delay": 1.0, "healthy_samples": 500.0, "probe_effort": 0.0, "probe_samples": 120.0,
        "probe_inertia": 0.0, "probe_noise": 0.0, "probe_moving": 0.1, "probe_evidence": 25.0,
        "probe_travel": math.inf, "probe_energy": math.inf, "probe_answer_error": 0.0,
        **dict.fromkeys(PROBE_ANSWER_NAMES, 0.0),
        "shaking_limit": math.inf, "shaking_time": 0.33, "shaking_slow": 6.0,
        "unexplained_limit": math.inf, "unexplained_gain": 0.0, "unexplained_offset": 0.02 * EFFORT + 0.1,
        "unexplained_memory": 0.1, "drive_delay": math.inf, "drive_delay_rate": 0.08 * EFFORT,
        "drive_delay_smoothing": 20.0, "drive_delay_forget": 0.4, "drive_delay_share": 0.5,
            "rate_samples": 250.0, "rate_tolerance": 0.2, "still_samples": 0.0, "still_effort": 0.0,
            "still_half_wave": 32.0,
    }  # fmt: skip
    assert thresholds() == pytest.approx(expected, rel=1e-9)


def changes(**settings):
    """The thresholds that differ from those of the joint above."""
    usual, found = thresholds(), thresholds(**settings)
    return {name: value for name, value in found.items() if value != usual[name]}


def test_heavier_limits_of_the_wearer_and_lighter_ones():
    """Shares of the limit of effort count where the joint's own acceleration needs less."""
    light = {"gravity_sine": 0.1, "gravity_cosine": 0.0, "offset": 0.0}
    s = thresholds(joint(inertia=0.02, **light))
    assert (s["wearer_torque"], s["wearer_push"]) == pytest.approx((0.75, 4.8))
    s = thresholds(joint(inertia=0.02, velocity_limit=math.inf, **light))
    assert (s["wearer_torque"], s["wearer_push"]) == pytest.approx((0.75, 4.8))
    assert (s["power_limit"], s["budget_store"], s["budget_power"]) == (math.inf, math.inf, 0.0)
    assert s["ringing_limit"] == pytest.approx(0.69)


def test_weight_that_the_law_leaves_to_the_wearer():
    s = thresholds(joint(effort_limit=1.2))
    left = WEIGHT - 1.2
    assert s["push_limit"] == pytest.approx(1.2 + left)
    assert s["wearer_torque"] == pytest.approx(max(1.0 + left, 27.0 * INERTIA + 0.4 * WEIGHT))
    assert s["wearer_push"] == pytest.approx(INERTIA * SPEED / 0.065 + left)
    assert s["force_tolerance"] == pytest.approx(0.066 * 1.2 + 0.2 * left + 0.4 * WEIGHT)
    assert s["force_burst"] == pytest.approx(0.8 * 1.2 + 0.2 * left + 0.4 * WEIGHT)
    assert s["budget_store"] == pytest.approx(INERTIA * 5.75**2 + 0.66 * left)
    assert (s["hold_limit"], s["power_limit"]) == pytest.approx((1.2, 12.0))
    assert s["degrades"] == 1.0
    half = thresholds(joint(gravity_share=0.5, viscous_negative=0.2))
    assert half["push_limit"] == pytest.approx(EFFORT + 0.5 * WEIGHT)
    assert half["power_limit"] == pytest.approx((0.5 * WEIGHT + REST + 0.2 * SPEED + ROOT * math.sqrt(SPEED)) * SPEED)
    assert half["degrades"] == 0.0
    assert thresholds(joint(gravity_share=0.6))["degrades"] == 1.0


def test_power_is_half_of_both_limits_where_weight_and_friction_take_less():
    light = dict.fromkeys(("gravity_sine", "gravity_cosine", "offset", "viscous_negative", "square_root"), 0.0)
    assert thresholds(joint(**light))["power_limit"] == pytest.approx(25.0)
    assert thresholds(joint(viscous_negative=2.0))["power_limit"] == pytest.approx(50.0)


def test_ringing_of_reversals():
    """Four reversals a second of the friction that is carried, at a tenth of the velocity limit."""
    rough = thresholds(joint(viscous_negative=2.5))
    assert rough["ringing_limit"] == pytest.approx(0.44 * 0.8 * (REST + 2.5 + ROOT))
    assert thresholds(joint(viscous_negative=9.0))["ringing_limit"] == pytest.approx(0.44 * EFFORT)
    unlimited = thresholds(joint(coulomb_positive=3.0, velocity_limit=math.inf))
    assert unlimited["ringing_limit"] == pytest.approx(0.44 * 0.8 * (REST + 2.7))
    directional = law_of("directional", coulomb_up=2.0, viscous_up=0.5, gravity_sine_up=3.0, gravity_sine_down=3.0)
    assert not {"friction_share", "gravity_share"} & set(directional.values)  # the law carries all of both
    s = supervised(directional).supervision
    assert s["ringing_limit"] == pytest.approx(0.44 * 2.5)
    assert (s["degrades"], s["push_limit"]) == (1.0, EFFORT)


@pytest.mark.parametrize(
    ("period", "freeze", "quiet", "rest", "samples"),
    [(1e-4, 200, 500, 1000, 200), (4e-3, 5, 12, 25, 8), (0.02, 2, 2, 5, 8), (0.08, 2, 2, 2, 8)],
)
def test_counts_and_filters_by_the_period(period, freeze, quiet, rest, samples):
    s = thresholds(joint(period=period, max_age=5.0 * period))
    assert (s["freeze_samples"], s["test_rest"]) == (freeze, rest)
    assert s["force_quiet_samples"] == s["muscle_quiet_samples"] == quiet
    assert s["test_samples"] == samples
    assert s["rate_samples"] == max(10, round(0.25 / period))
    assert s["residual_bandwidth"] == pytest.approx(min(40.0, 0.2 / period))
    assert s["residual_slow"] == pytest.approx(min(5.0, 0.05 / period))
    assert s["shaking_slow"] == pytest.approx(min(6.0, 0.2 / period))
    for name, usual in (("slowest", 20.0), ("fastest", 100.0), ("memory", 3.0)):
        assert s[f"ringing_{name}"] == pytest.approx(min(usual, 0.2 / period))
    for name, usual in (("smoothing", 20.0), ("forget", 0.4)):
        assert s[f"drive_delay_{name}"] == pytest.approx(min(usual, 0.2 / period))
    assert s["freeze_speed"] == pytest.approx(500.0 * period + 4e-4 / period)
    assert s["hold_damping"] == pytest.approx(0.05 * INERTIA / period)
    assert s["drive_forget"] == pytest.approx(-math.expm1(-period / 10.0))


def test_instruments():
    given = Instruments(encoder_resolution=1e-3, joint_encoder=True, joint_tolerance=0.2, drive=True, drive_limit=7.0,
                        drive_gain_error=0.02, drive_offset=0.01, force_range=25.0, emg_range=30.0)  # fmt: skip
    found = changes(instruments=given, start_up=False)
    expected = {
        "encoder_resolution": 1e-3, "joint_expected": 1.0, "joint_tolerance": 0.2, "drive_expected": 1.0,
        "drive_limit": 7.0, "force_range": 25.0, "muscle_range": 30.0, "drive_gain": 0.02, "drive_offset": 0.01,
        "test_effort": 0.0, "drive_delay": 13e-3, "freeze_speed": 1.5,
    }  # fmt: skip
    assert {name: value for name, value in found.items() if name not in ("test_least", "test_most")} == pytest.approx(
        expected
    )
    usual = Instruments()
    assert (usual.joint_tolerance, usual.emg_range, usual.drive_limit) == (0.05, 40.0, math.inf)
    assert (usual.drive_gain_error, usual.drive_lag, usual.force_gain_error) == (0.05, 2e-3, 0.0)
    completed = usual.completed(8.0)
    assert (completed.drive_offset, completed.drive_noise, completed.force_offset) == pytest.approx((0.08, 0.08, 0.16))
    assert completed.encoder_resolution == 4e-4
    values = LAWS["transparent"].defaults | {n: x for n, x in NUMBERS.items() if n in LAWS["transparent"].defaults}
    law = ControlLaw("transparent", values)
    for uses in ((), ("interaction",), ("muscle",)):
        s = supervised(law.using(*uses)).supervision
        assert s["force_expected"] == float("interaction" in uses)
        assert s["muscle_expected"] == float("muscle" in uses)


ACCURATE = {"drive_gain_error": 0.05, "drive_offset": 0.01 * EFFORT, "drive_noise": 0.01 * EFFORT, "drive_lag": 2e-3,
            "force_offset": 0.02 * EFFORT, "force_gain_error": 0.0, "encoder_resolution": 4e-4}  # fmt: skip


def test_the_usual_accuracy_stated_is_the_usual_supervisor_bit_by_bit():
    assert thresholds(instruments=Instruments(**ACCURATE)) == thresholds()
    better = {name: 0.5 * value for name, value in ACCURATE.items() if name.endswith(("noise", "lag"))}
    assert thresholds(instruments=Instruments(**ACCURATE | better | {"force_offset": 0.0})) == thresholds()


@pytest.mark.parametrize(
    ("worse", "expected"),
    [
        ({"drive_answer": 1.12}, {"drive_answer": 1.12}),
        ({"drive_gain_error": 0.12}, {"drive_gain": 0.12, "drive_share": 0.15 + 0.07}),
        ({"drive_gain_error": 0.99}, {"drive_gain": 0.99, "drive_share": 1.0}),
        ({"drive_offset": 0.03 * EFFORT}, {"drive_offset": 0.03 * EFFORT, "drive_tolerance": 0.07 * EFFORT}),
        ({"drive_noise": 0.02 * EFFORT}, {"drive_tolerance": 0.08 * EFFORT}),
        ({"drive_lag": 7e-3}, {"drive_cycles": 4.0 + 32.0, "drive_late": math.exp(-1.0 / 9.5)}),
        ({"drive_lag": 22e-3}, {"drive_cycles": 4.0 + 47.0, "drive_late": math.exp(-1.0 / 24.5)}),
    ],
)
def test_a_worse_measurement_of_the_drive_widens_its_watch(worse, expected):
    assert changes(instruments=Instruments(**ACCURATE | worse)) == pytest.approx(expected)


def test_a_measured_drive_is_watched_for_being_late():
    measured = Instruments(drive=True, drive_limit=10.0)
    assert thresholds(instruments=measured)["drive_delay"] == pytest.approx(12e-3 + PERIOD)
    slow = thresholds(instruments=replace(measured, drive_lag=7e-3))
    assert slow["drive_delay"] == pytest.approx(12e-3 + PERIOD + 5e-3)
    fast = thresholds(instruments=replace(measured, drive_lag=1e-3))
    assert fast["drive_delay"] == thresholds(instruments=measured)["drive_delay"], "a fast measurement is no fast drive"
    assert fast["drive_late"] == thresholds(instruments=measured)["drive_late"]


@pytest.mark.parametrize(("period", "still"), [(2e-3, 200.0), (1e-3, 400.0), (5e-4, 800.0), (3e-4, 1333.0)])
def test_a_joint_that_rests_is_asked(period, still):
    """By the wave of the start-up test, which moves the robot against its friction, also without such a test."""
    law = joint(period=period, max_age=5.0 * period)
    asked = thresholds(law, instruments=Instruments(probe=True, encoder_resolution=1e-5), start_up=False)
    tested = thresholds(law, instruments=Instruments(encoder_resolution=1e-5))
    assert (asked["still_samples"], asked["test_effort"]) == (still, 0.0)
    assert (asked["still_effort"], asked["still_half_wave"]) == (tested["test_effort"], tested["test_samples"])
    assert asked["still_half_wave"] == round(0.032 / period)
    exported = {probe: Instruments(drive=True, probe=probe, encoder_resolution=1e-5) for probe in (None, False)}
    told = [thresholds(law, instruments=one)["still_samples"] for one in exported.values()]
    assert told == [0.0, still], "an export asks a joint with a measured drive, too"


def test_rates_that_a_slow_period_cannot_follow():
    assert thresholds(joint(period=0.4, max_age=2.0))["drive_delay_forget"] == pytest.approx(0.4)
    assert thresholds(joint(period=0.8, max_age=4.0))["drive_delay_forget"] == pytest.approx(0.25)


def test_weight_of_the_wearer_widens_the_push():
    """A law that carries weight of the wearer may push by as much more."""
    usual = thresholds()
    held = thresholds(replace(joint(), supported=1.5, unstated=0.25))
    assert held["push_limit"] == pytest.approx(usual["push_limit"] + 1.75)
    assert held["power_limit"] > usual["power_limit"]


@pytest.mark.parametrize(("half", "swing"), [(0.4, 0.8), (2.0, 2.0)])
def test_supported_weight_may_be_lifted_over_the_swing(half, swing):
    law = joint(position_min=-half, position_max=half)
    laws = law, replace(law, supported=1.5), replace(law, unstated=0.5)
    store = [thresholds(each)["budget_store"] for each in laws]
    assert store[1] - store[0] == pytest.approx(1.5 * swing)
    assert store[2] - store[0] == pytest.approx(0.5 * swing)


def test_a_stated_load_adds_inertia_and_weight():
    load = Segment(1.5, 0.15, 0.06)
    loaded = rules.loaded_body({"inertia": 0.05, "gravity_sine": 1.2}, replace(joint(), load=load))
    assert loaded["inertia"] == pytest.approx(0.05 + load.inertia)
    assert loaded["gravity_sine"] == pytest.approx(1.2 + load.gravity())


@pytest.mark.parametrize(("inertia", "speed"), [(0.005, 2.0), (0.05, 10.0), (0.05, 20.0), (0.4, 2.0)])
@pytest.mark.parametrize(("weight", "carried", "supported", "unstated"),
                         [(3.0, 2.0, 0.0, 0.5), (1.0, 2.0, 0.0, 0.0), (6.5, 0.0, 1.5, 0.25)])  # fmt: skip
def test_thresholds_by_weights_that_are_carried(inertia, speed, weight, carried, supported, unstated):
    """A stated load is known within a tenth, the rest of the weight within two fifths, an unstated load not at all."""
    plain = dict.fromkeys(("gravity_cosine", "offset", "viscous_negative", "viscous_positive", "square_root"), 0.0)
    numbers = plain | {"inertia": inertia, "gravity_sine": weight + supported, "velocity_limit": speed}
    load = Segment(carried / (9.81 * 0.2), 0.2, 0.01) if carried else None
    s = thresholds(replace(joint(**numbers), load=load, supported=supported, unstated=unstated))
    left = max(weight - EFFORT, 0.0)
    exchanged = left + supported + unstated
    stated = 0.0 if load is None else load.gravity()
    wrong = 0.4 * max(weight - stated, 0.0) + 0.1 * stated + unstated
    torque = max(0.15 * EFFORT + exchanged, 2.0 * inertia * speed + exchanged, 27.0 * inertia + wrong)
    push = max(0.96 * EFFORT + exchanged, inertia * speed / 0.065 + exchanged, 75.0 * inertia + wrong)
    friction = LEVEL + LOAD * weight
    swung = 2.0 * (supported + unstated)
    assert (s["wearer_torque"], s["wearer_push"], s["push_limit"]) == pytest.approx((torque, push, EFFORT + exchanged))
    assert s["force_tolerance"] == pytest.approx(0.066 * EFFORT + 0.2 * exchanged + wrong)
    assert s["force_burst"] == pytest.approx(0.8 * EFFORT + 0.2 * exchanged + wrong)
    assert s["force_excess"] == pytest.approx(0.022 * EFFORT + wrong)
    assert s["budget_store"] == pytest.approx(inertia * (0.575 * speed) ** 2 + 0.66 * left + swung)
    due = min(EFFORT, weight - left + supported + friction)
    assert s["power_limit"] == pytest.approx(max(0.5 * EFFORT, due) * speed)
    assert s["hold_limit"] == pytest.approx(min(EFFORT, 1.5 * weight + friction))
    assert s["raw_acceleration_limit"] == pytest.approx(10.0 * EFFORT / inertia)


def test_sustained_oscillation_is_watched_on_request():
    found = changes(instruments=Instruments(shaking=True))
    assert found == {"shaking_limit": pytest.approx(0.016 * SPEED)}


def test_a_worse_force_sensor_widens_its_watch():
    usual = thresholds()
    found = changes(instruments=Instruments(force_offset=0.05 * EFFORT))
    offset = ("force_tolerance", "force_burst", "force_excess", "unexplained_offset")
    more = {name: usual[name] + 0.03 * EFFORT for name in offset}
    assert found == pytest.approx(more)
    found = changes(instruments=Instruments(force_gain_error=0.1))
    expected = {"force_tolerance": "wearer_torque", "force_burst": "wearer_push"}
    more = {name: usual[name] + 0.1 * usual[most] for name, most in expected.items()}
    assert found == pytest.approx({**more, "unexplained_gain": 0.1})
    assert thresholds(instruments=Instruments(force_gain_error=1.5))["unexplained_gain"] == 1.0


def test_energy_that_nobody_accounts_for():
    """Errors of a model lend energy: of its weight over the range, its inertia, and the encoder in two periods."""
    swing, usual = 0.4 * 1.5, 5.75

    def limit(*, sensed=True, settings=None, **changed):
        values = LAWS["transparent"].defaults | {n: x for n, x in NUMBERS.items() if n in LAWS["transparent"].defaults}
        law = ControlLaw("transparent", values | changed).using(*(("interaction",) if sensed else ()))
        return supervised(law, **(settings or {})).supervision["unexplained_limit"]

    moving = INERTIA * usual * (0.2 * usual + 4e-4 / PERIOD)
    assert limit() == pytest.approx(swing * 2.0 + moving)
    assert limit(sensed=False) == math.inf
    assert limit(position_max=-0.5) == pytest.approx(swing * 1.5 + moving)
    assert limit(position_max=0.0) == limit(position_max=math.inf, position_min=-math.inf) == limit()
    assert limit(offset=3.0) == limit()
    assert limit(velocity_limit=math.inf) == math.inf
    assert limit(velocity_limit=2.0 * SPEED) == pytest.approx(
        swing * 2.0 + 2.0 * INERTIA * usual * (0.4 * usual + 4e-4 / PERIOD)
    )
    coarse = {"instruments": Instruments(encoder_resolution=1e-3)}
    assert limit(settings=coarse) == pytest.approx(swing * 2.0 + INERTIA * usual * (0.2 * usual + 1e-3 / PERIOD))
    assert limit(settings={"body": dict.fromkeys(body_of(joint()), 0.0)}) == math.inf


@pytest.mark.parametrize(
    "wrong",
    [{"drive_offset": -0.1}, {"drive_noise": math.nan}, {"encoder_resolution": 0.0}, {"force_range": 0.0},
     {"spring_stiffness": 0.0}, {"start_up_answer": 0.0}, {"drive_lag": -1e-3}, {"drive_gain_error": -0.1}],
)  # fmt: skip
def test_an_impossible_instrument_is_refused(wrong):
    with pytest.raises(PellucidError, match=f"instruments: {next(iter(wrong))}: found .*, expected"):
        Instruments(**wrong)


def test_a_commissioned_answer_has_closer_bounds():
    found = changes(instruments=Instruments(start_up_answer=0.5))
    assert found == pytest.approx({"test_least": 0.1, "test_most": 0.875})


def test_without_a_body_nothing_is_held_against_a_model():
    s = thresholds(body=dict.fromkeys(body_of(joint()), 0.0))
    for name in ("raw_acceleration_limit", "wearer_torque", "wearer_push", "force_tolerance", "force_burst",
                 "force_excess", "budget_store", "test_most"):  # fmt: skip
        assert s[name] == math.inf, name
    assert (s["hold_damping"], s["hold_limit"], s["test_effort"]) == (0.0, 0.0, 0.0)
    assert (s["push_limit"], s["power_limit"], s["ringing_limit"]) == pytest.approx((5.0, 25.0, 0.69))


# --- bodies ----------------------------------------------------------------------------------------------------------


def law_of(kind, **numbers):
    known = LAWS[kind].defaults
    return ControlLaw(kind, known | {n: x for n, x in (NUMBERS | numbers).items() if n in known})


def test_bodies_of_laws():
    ways = {f"{name}_{way}": value for name, values in {
        "inertia": (0.04, 0.08), "gravity_sine": (2.0, 1.0), "gravity_cosine": (0.4, 0.2), "coulomb": (0.3, 0.5),
        "viscous": (0.06, 0.02)}.items() for way, value in zip(("up", "down"), values, strict=True)}  # fmt: skip
    found = body_of(law_of("directional", **ways))
    assert (found["inertia"], found["gravity_sine"], found["gravity_cosine"]) == pytest.approx((0.06, 1.5, 0.3))
    assert (found["coulomb"], found["viscous"], found["offset"]) == pytest.approx((0.5, 0.06, 0.0))
    negative = ways | {"inertia_up": -0.4, "inertia_down": 0.1}
    assert body_of(law_of("directional", **negative))["inertia"] == 0.0
    found = body_of(law_of("position_prediction", stiffness=400.0, coulomb=0.3))
    assert (found["inertia"], found["coulomb"]) == pytest.approx((0.04, 0.3))
    found = body_of(law_of("worn", orthosis_inertia=0.04, actuator_inertia=0.01, orthosis_gravity=1.7))
    assert (found["inertia"], found["gravity_sine"], found["gravity_cosine"]) == pytest.approx((0.05, 1.7, 0.0))


def test_friction_with_other_powers_is_never_underestimated(monkeypatch):
    found = {(0.0, 0.0): 0.5, (2.0, 0.0): 0.01, (0.5, 1.0): 0.02, (0.25, 0.0): 0.03, (0.0, 1.0): 3.0, (0.75, 0.0): 0.05}
    monkeypatch.setattr(rules, "friction_coefficients", lambda *_: found)
    made = rules.body_friction(joint(), 2.0)
    assert made == pytest.approx({
        "coulomb": 0.5 + 0.03 * SPEED**0.25, "load": 1.0, "viscous": 0.01 * SPEED,
        "square_root": 0.02 * 2.0 + 0.05 * SPEED**0.25,
    })  # fmt: skip
    unlimited = joint(velocity_limit=math.inf)
    with pytest.raises(PellucidError, match=r"speed\^2 and no velocity limit"):
        rules.body_friction(unlimited, 2.0)
    monkeypatch.setattr(rules, "friction_coefficients", lambda *_: {(2.0, 0.0): 0.0, (0.0, 0.0): 0.5})
    assert rules.body_friction(unlimited, 2.0)["coulomb"] == 0.5
    assert rules.weight_of({"gravity_sine": 3.0, "gravity_cosine": -4.0, "offset": -0.5}) == 5.5
    body = {"coulomb": 0.5, "load": 0.25, "viscous": 0.125, "square_root": 2.0}
    assert rules.body_resistance(body, 4.0, 8.0) == 0.5 + 2.0 + 0.5 + 4.0
    assert rules.body_resistance({"viscous": 2.0}, 4.0, 8.0) == 8.0


# --- the test at start-up --------------------------------------------------------------------------------------------


def test_the_wave_grows_until_the_encoder_tells():
    room = {"limit": 50.0, "rate": 1e6, "period": PERIOD}
    assert start_up_wave(0.05, 0.5, 1e-4, **room) == waved(3.0, 32, 0.5)
    fine, coarse = half_wave(3.0, 32, 0.5 / 0.7, 0.05)[1], half_wave(3.3, 36, 0.5 / 0.7, 0.05)[1]
    assert start_up_wave(0.05, 0.5, fine / 4.0, **room) == waved(3.0, 32, 0.5)
    assert start_up_wave(0.05, 0.5, 1.001 * fine / 4.0, **room) == waved(3.3, 36, 0.5)
    assert start_up_wave(0.05, 0.5, 0.999 * coarse / 4.0, **room) == waved(3.3, 36, 0.5)
    assert start_up_wave(0.05, 0.5, 1.001 * coarse / 4.0, **room) == waved(3.63, 40, 0.5)


def waved(effort, samples, friction, inertia=0.05, change=math.inf):
    work, _ = half_wave(effort, samples, friction / 0.7, inertia, change=change)
    free = 2.0 * (effort * samples * PERIOD / math.pi) ** 2 / inertia
    return Approximately(StartUpWave(effort, samples, 0.1 * work, 2.5 * free))


class Approximately:
    """A wave that equals another within rounding."""

    def __init__(self, wave):
        self.wave = wave

    def __eq__(self, other):
        return vars(other) == pytest.approx(vars(self.wave), rel=1e-9)

    def __repr__(self):
        return repr(self.wave)


def test_the_wave_stays_within_the_limits():
    limited = start_up_wave(0.05, 0.5, 1e-4, limit=1.5, rate=1e6, period=PERIOD)
    assert limited == waved(1.5, 32, 0.5)
    longest = half_wave(1.0, 200, 0.5 / 0.7, 0.05)[1]
    assert start_up_wave(0.05, 0.5, 0.99 * longest / 4.0, limit=1.0, rate=1e6, period=PERIOD).samples == 200
    blind = start_up_wave(0.05, 0.5, 1.01 * longest / 4.0, limit=1.0, rate=1e6, period=PERIOD)
    free = 2.0 * (1.0 * 0.2 / math.pi) ** 2 / 0.05
    assert blind == Approximately(StartUpWave(0.0, 200, 0.1 * free, 2.5 * free))
    strong = half_wave(50.0, 200, 0.5 / 0.7, 0.05)[1]
    assert start_up_wave(0.05, 0.5, 0.99 * strong / 4.0, limit=50.0, rate=1e6, period=PERIOD).effort == 50.0
    slow = start_up_wave(0.05, 0.5, 1e-4, limit=50.0, rate=100.0, period=PERIOD)
    assert slow == waved(2.0, 32, 0.5, change=0.1)
    quick = start_up_wave(0.05, 0.5, 1e-4, limit=50.0, rate=250.0, period=PERIOD)
    assert quick == waved(250.0 * 0.032 / math.pi, 32, 0.5, change=0.25)


def test_the_wave_overcomes_the_friction_that_was_identified():
    """A law may carry less friction than there is; a joint that then sticks would be called one of wrong polarity."""
    assert thresholds()["test_effort"] == pytest.approx(REST + 50.0 * INERTIA)
    assert thresholds(rest_friction=0.5 * REST)["test_effort"] == pytest.approx(REST + 50.0 * INERTIA)
    sticking = thresholds(rest_friction=REST + 1.0)
    assert sticking["test_effort"] == pytest.approx(REST + 1.0 + 50.0 * INERTIA)
    assert sticking["body_coulomb"] == LEVEL
    weak = joint(effort_limit=REST + 1.0)
    assert thresholds(weak, rest_friction=REST)["test_effort"] > 0.0
    assert thresholds(weak, rest_friction=REST + 1.0)["test_effort"] == 0.0


# --- the worn law ----------------------------------------------------------------------------------------------------


def test_a_worn_law_is_watched_by_its_spring():
    law = law_of("worn", effort_limit=10.0, orthosis_inertia=0.04, actuator_inertia=0.05, actuator_coulomb=2.5)
    plain = watched_worn(law).supervision
    assert (plain["joint_expected"], plain["drive_expected"], plain["encoder_resolution"]) == (0.0, 0.0, 1e-3)
    assert (plain["body_inertia"], plain["test_effort"], plain["muscle_expected"]) == (0.0, 0.0, 0.0)
    assert plain["ringing_limit"] == plain["drive_limit"] == plain["wearer_torque"] == math.inf
    spring = Instruments(joint_encoder=True, drive=True, drive_limit=30.0, spring_stiffness=200.0)
    s = watched_worn(law, spring).supervision
    expected = {
        "encoder_resolution": 1e-3, "joint_expected": 1.0, "joint_tolerance": 0.1, "drive_expected": 1.0,
        "drive_limit": 30.0, "drive_offset": 0.02, "drive_tolerance": 5.0 + 1.4 * 2.5, "drive_share": 0.25,
        "drive_cycles": 40.0,
        "drive_surplus": 0.05, "drive_inertia": 1.4 * 0.05, "drive_late": math.exp(-1.0 / 24.0),
        "drive_gain": 0.05, "muscle_expected": 0.0, "ringing_limit": math.inf, "drive_delay": math.inf,
        "test_effort": 0.0, "body_inertia": 0.0, "push_limit": 10.0,
    }  # fmt: skip
    assert {name: s[name] for name in expected} == pytest.approx(expected)
    assert watched_worn(law, replace(spring, drive_limit=math.inf)).supervision["drive_limit"] == math.inf
    blind = watched_worn(law, replace(spring, joint_encoder=False)).supervision
    assert {n: v for n, v in blind.items() if v != s[n]} == {"joint_expected": 0.0, "drive_surplus": 0.2}
    stiff = watched_worn(law, replace(spring, spring_stiffness=1e4, joint_tolerance=0.03)).supervision
    assert stiff["joint_tolerance"] == 0.03


# --- limits from cards -----------------------------------------------------------------------------------------------


def card(**friction):
    found = {"inertia": 0.05, "gravity_sine": 3.0, "gravity_cosine": 4.0, "offset": -0.5} | friction
    parameters = tuple(
        CardParameter(name, "1", value, 0.0, (0.5 * value, 2.0 * value)) for name, value in found.items()
    )
    return ModelCard(
        study="bench", family="symmetric", method="", motion="rotary", effort_unit="N*m", lifts="",
        parameters=parameters, covariance=(), known={"viscous": 0.2}, velocity_range=4.0, drive={"gain": 1.0},
        heldout_effort_error=None, processing="", confidence=0.95, checksums={}, pellucid="0",
    )  # fmt: skip


GATE = {
    "effort_limit": 3.0, "rate_limit": 70.0, "velocity_limit": 4.0, "position_min": -0.7, "position_max": 1.3,
    "stop_margin": 0.2, "max_age": 0.01, "max_repeats": 2.0, "period": 2e-3,
}  # fmt: skip
"""Numbers of a gate whose limits are stated; a sample may be five periods old and be seen twice again."""


def test_limits_that_a_card_suggests():
    one = card(coulomb=0.4)
    body = joint_compensation.carried_body(one)
    assert body["coulomb_positive"] == body["coulomb_negative"] == pytest.approx(0.2)  # the lower end is carried
    assert body["viscous_positive"] == 0.2
    assert (body["gravity_sine"], body["offset"], body["velocity_width"]) == pytest.approx((3.0, -0.5, 0.08))
    limits = joint_compensation.suggested_limits(one)
    effort = 5.0 + 0.5 + 0.8 * (0.2 + 0.2 * 4.0)
    assert (limits.effort, limits.rate, limits.velocity) == pytest.approx((effort, effort / 0.02, 6.0))
    assert (limits.position, limits.stop_margin) == ((-math.inf, math.inf), 0.0)
    law = joint_compensation.compensation(one)
    assert (law.values["period"], law.values["effort_limit"]) == pytest.approx((1e-3, effort))
    assert law.values["max_age"] == pytest.approx(5e-3)
    given = joint_compensation.compensation(one, limits=Limits(2.0), period=2e-3, friction_share=0.5)
    assert (given.values["period"], given.values["effort_limit"], given.values["friction_share"]) == (2e-3, 2.0, 0.5)
    stated = joint_compensation.compensation(one, limits=Limits(3.0, 70.0, 4.0, (-0.7, 1.3), 0.2), period=2e-3).values
    assert {name: stated[name] for name in GATE} == pytest.approx(GATE)  # what is stated is what the gate lets through
    with pytest.raises(PellucidError, match="found a place of a carriage"):
        joint_compensation.carried_body(one, 0.1)
    still = ModelCard(**vars(one) | {"velocity_range": 0.0})
    with pytest.raises(PellucidError, match="found a velocity range of 0"):
        joint_compensation.known_speed(still)


def test_what_may_be_carried_of_friction():
    carried = joint_compensation.carried
    assert carried(CardParameter("inertia", "1", 2.0, 0.0, (1.0, 3.0))) == 2.0
    assert carried(CardParameter("coulomb", "1", 2.0, 0.0, (1.0, 3.0))) == 1.0
    assert carried(CardParameter("coulomb", "1", 2.0, 0.0, (-1.0, 3.0))) == 0.0
    assert carried(CardParameter("coulomb", "1", 2.0, 0.0, (1.0, 3.0), carried=1.5)) == 1.5


def test_a_joint_with_a_carriage():
    found = {
        "inertia": 0.03, "carriage_moment": -0.004, "gravity": 1.15, "gravity_cosine": 0.26, "coulomb_positive": 0.26,
        "coulomb_negative": 0.21, "viscous_positive": 0.05, "viscous_negative": 0.04, "load_motoring": 0.13,
        "load_generating": 0.11,
    }  # fmt: skip
    one = SliderCard(
        study="bench", family="load", method="", motion="rotary", effort_unit="N*m", lifts="flexion",
        parameters=tuple(CardParameter(n, "1", v, 0.0, (v, v)) for n, v in found.items()), covariance=(),
        known={"carriage_mass": 0.48}, rail=(0.12, 0.28), drive={"gain": 1.0}, heldout_error=None, residual_sd=0.0,
        processing="", confidence=0.95, notes=(), checksums={}, pellucid="0",
    )  # fmt: skip
    assert joint_compensation.known_speed(one) == 3.0
    amid, there = joint_compensation.carried_body(one), joint_compensation.carried_body(one, 0.2)
    assert amid == there
    assert there["velocity_width"] == pytest.approx(0.06)
    assert joint_compensation.carried_body(one, 0.28)["gravity_sine"] > there["gravity_sine"]
    assert joint_compensation.suggested_limits(one).velocity == pytest.approx(4.5)


def test_limits_that_are_not_given():
    usual = Limits()
    assert (usual.effort, usual.rate, usual.velocity, usual.emg_torque) == (10.0, 300.0, 15.0, 40.0)
    assert (usual.position, usual.stop_margin) == ((-0.6, 2.2), 0.1)


# --- several joints --------------------------------------------------------------------------------------------------

RANGES = (
    JointRange(-1.0, 1.5, effort=12.0, velocity=4.0),
    JointRange(-1.5, 1.0, seen_velocity=2.0),
    JointRange(seen_low=-0.5, seen_high=0.7, effort=9.0, seen_velocity=3.0, velocity=5.0),
    JointRange(low=-0.2, effort=7.0, seen_velocity=2.5),
)


REACH = {
    "weight": [0.0, 10.76001300417022, 2.7628197828979557, 1.1751202206008988],
    "inertia": [0.09105143422065437, 0.3504659500991731, 0.11250540168444005, 0.08],
    "end_speed": 3.1204028232064895,
    "upper_speed": 1.9681188344114044,
}
"""What 400 drawn postures have of this arm."""

COUPLED = [0.9364421114069041, 0.7795017604313191, 0.5308363211341978, 0.1925074451930921]
"""Largest inertia with all joints accelerated alike, whichever way."""


@pytest.fixture(scope="module")
def robot():
    return arm(ranges=RANGES)


def test_what_joints_ask_within_their_ranges(robot):
    reach = tree_laws.reach_of(robot)
    np.testing.assert_array_equal(reach.speed, [4.0, 2.0, 3.0, 2.5])
    np.testing.assert_allclose(reach.weight, REACH["weight"], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(reach.inertia, REACH["inertia"], rtol=1e-9)
    np.testing.assert_allclose(
        reach.friction, 0.3 + 0.12 * reach.speed + 0.05 * reach.weight + 0.05 * np.sqrt(reach.speed), rtol=1e-9
    )
    assert reach.end_speed == pytest.approx(REACH["end_speed"], rel=1e-9)
    assert tree_laws.reach_of(robot, 2, (0.0, 0.0, -0.1)).end_speed == pytest.approx(REACH["upper_speed"], rel=1e-9)


def test_a_slide_of_which_no_range_is_known_is_where_it_is():
    """A hinge is drawn all around, a slide has no natural range."""
    rows = np.array(arm().links)
    rows[3, COLUMNS["links"].index("joint")] = 2.0
    slide = {"links": tuple(map(tuple, rows.tolist()))}
    known = (JointRange(-1.0, 1.0, seen_velocity=2.5),) * 3
    free, held = (
        tree_laws.reach_of(arm(**slide, ranges=(*known, last)))
        for last in (JointRange(seen_velocity=2.5), JointRange(0.0, 0.0, seen_velocity=2.5))
    )
    np.testing.assert_array_equal(free.inertia, held.inertia)
    assert free.end_speed == held.end_speed
    hinge = tree_laws.reach_of(arm(ranges=(*known, JointRange(seen_velocity=2.5))))
    assert not np.allclose(
        hinge.inertia, tree_laws.reach_of(arm(ranges=(*known, JointRange(0.0, 0.0, seen_velocity=2.5)))).inertia
    )


def test_a_joint_without_any_body_has_the_least_inertia():
    rows = np.zeros_like(np.array(arm().links))
    bare = np.array(arm().links)
    kept = [COLUMNS["links"].index(name) for name in ("parent", "joint", "axis_x", "axis_y", "axis_z", "z")]
    rows[:, kept] = bare[:, kept]
    reach = tree_laws.reach_of(arm(links=tuple(map(tuple, rows.tolist()))))
    np.testing.assert_allclose(reach.inertia, 1e-6, rtol=1e-12)
    np.testing.assert_allclose(reach.heaviest, 1e-6, rtol=1e-12)


def test_limits_of_each_joint(robot):
    reach = tree_laws.reach_of(robot)
    limits = tree_laws.suggested_limits(robot, reach)
    due = reach.weight[1] + reach.friction[1]
    assert [one.effort for one in limits] == pytest.approx([12.0, due, 9.0, 7.0])
    assert [one.rate for one in limits] == pytest.approx([600.0, due / 0.02, 450.0, 350.0])
    assert [one.velocity for one in limits] == pytest.approx([4.0, 3.0, 5.0, 3.75])
    assert [one.position for one in limits] == [(-1.0, 1.5), (-1.5, 1.0), (-math.inf, math.inf), (-0.2, math.inf)]
    assert [one.stop_margin for one in limits] == pytest.approx([0.05, 0.05, 0.0, 0.0])
    silent = arm(ranges=(JointRange(-1.0, 1.0),) * 4)
    with pytest.raises(PellucidError, match="found no speed"):
        tree_laws.reach_of(silent)
    floating = tree_laws.reach_of(robot)
    weightless = replace(floating, weight=0.0 * floating.weight, friction=0.0 * floating.friction)
    with pytest.raises(PellucidError, match="found neither gravity nor friction"):
        tree_laws.suggested_limits(robot, weightless)


def test_every_threshold_of_several_joints(robot):
    law = tree_laws.carried(robot, wearer=[3.0, 4.0, 5.0, 6.0])
    reach, limits = tree_laws.reach_of(robot), tree_laws.suggested_limits(robot, tree_laws.reach_of(robot))
    for k, (watch, one) in enumerate(zip(law.watches, limits, strict=True)):
        effort, speed, inertia = one.effort, one.velocity, reach.inertia[k]
        expected = {
            "raw_speed_limit": speed, "raw_acceleration_limit": 10.0 * effort / inertia,
            "range_min": one.position[0] - 0.15, "range_max": one.position[1] + 0.15, "encoder_resolution": 4e-4,
            "freeze_speed": 0.9, "freeze_samples": 20.0, "drive_expected": 0.0, "drive_cycles": 4.0,
            "drive_tolerance": 0.05 * effort, "drive_share": 0.15, "drive_limit": math.inf,
            "drive_surplus": 0.005 * effort, "drive_late": 0.0, "drive_inertia": 0.0, "drive_answer": 1.0,
            "drive_gain": 0.05, "drive_offset": 0.01 * effort,
            "drive_forget": 1.0 - math.exp(-1e-4), "push_limit": effort, "power_limit": effort * speed,
            "budget_store": inertia * (0.575 * speed) ** 2 + reach.weight[k], "budget_power": 0.01 * effort * speed,
            "ringing_limit": 0.115 * effort, "ringing_slowest": 20.0, "ringing_fastest": 100.0, "ringing_memory": 3.0,
            "hold_damping": 50.0 * inertia, "hold_limit": min(effort, 1.5 * reach.weight[k] + reach.friction[k]),
            "outside_limit": 3.0 + k, "rest_speed": 0.3, "joint_expected": 0.0, "joint_tolerance": 0.05,
            "residual_slow": 5.0, "wearer_torque": max(0.15 * effort, reach.coupled[k] * speed / 0.5),
            "force_tolerance": math.inf, "force_burst": math.inf, "force_scale": math.inf, "force_expected": 0.0,
            "force_range": math.inf, "force_quiet_samples": 50.0, "muscle_expected": 0.0, "muscle_range": math.inf,
            "muscle_quiet_samples": 50.0, "test_effort": 0.0, "test_samples": 30.0, "test_rest": 100.0,
            "test_least": 0.0, "test_most": math.inf, "drive_delay": math.inf, "drive_delay_rate": 0.08 * effort,
            "drive_delay_smoothing": 20.0, "drive_delay_forget": 0.4, "drive_delay_share": 0.0,
        }  # fmt: skip
        assert dict(watch) == pytest.approx(expected, rel=1e-9)
    whole = sum(one.effort * one.velocity for one in limits) / 2.0
    assert dict(law.whole_watch) == pytest.approx({
        "raw_power_limit": whole, "raw_end_speed_limit": 1.5 * reach.end_speed, "reset_delay": 1.0,
        "healthy_samples": 500.0, "degrades": 1.0, "trusts_motion": 0.0, "force_excess": math.inf, "moving_speed": 0.2,
        "wrench_expected": 0.0, "wrench_quiet_samples": 50.0, "wrench_force_range": math.inf,
        "wrench_moment_range": math.inf,
    })  # fmt: skip
    assert (law.whole["power_limit"], law.whole["speed_limit"]) == pytest.approx((whole, 1.5 * reach.end_speed))
    assert (law.whole["observer_bandwidth"], law.whole["end_link"]) == (30.0, 4.0)
    for k, (share, one) in enumerate(zip(law.shares, limits, strict=True)):
        assert (share["gravity_share"], share["friction_share"], share["bandwidth"]) == (1.0, 0.8, 100.0)
        assert (share["innovation_gate"], share["period"], share["effort_limit"]) == (math.inf, 1e-3, one.effort)
        assert law.joints[k]["velocity_width"] == pytest.approx(0.02 * reach.speed[k])
    for watch, one, inertia in zip(tree_laws.carried(robot).watches, limits, reach.coupled, strict=True):
        assert watch["outside_limit"] == pytest.approx(max(0.8 * one.effort, inertia * one.velocity / 0.065))
    slow = tree_laws.carried(robot, period=0.02, friction_share=0.5, end="upper", end_point=(0.1, 0.2, 0.3))
    assert slow.whole["observer_bandwidth"] == pytest.approx(10.0)
    assert (slow.shares[0]["bandwidth"], slow.shares[0]["friction_share"]) == pytest.approx((25.0, 0.5))
    assert [slow.whole[name] for name in ("end_link", "end_x", "end_y", "end_z")] == [3.0, 0.1, 0.2, 0.3]
    weak = tree_laws.carried(robot, limits=(Limits(2.0, 100.0, 4.0, (-1.0, 1.0)),) * 4)
    left = np.maximum(reach.weight - 2.0, 0.0)
    assert left[1] > 5.0
    for k, watch in enumerate(weak.watches):
        assert watch["wearer_torque"] == pytest.approx(max(0.3, reach.coupled[k] * 8.0) + left[k])
        assert watch["outside_limit"] == pytest.approx(max(1.6, reach.coupled[k] * 4.0 / 0.065) + left[k])
    slow = tree_laws.carried(robot, limits=(Limits(50.0, 100.0, 0.01, (-1.0, 1.0)),) * 4)
    for watch in slow.watches:  # shares of the limit count where a joint's own acceleration needs less
        assert (watch["wearer_torque"], watch["outside_limit"]) == pytest.approx((7.5, 40.0))
    strong = (Limits(100.0, 5000.0, 4.0, (-1.0, 1.0)),) * 4
    held = tree_laws.carried(robot, limits=strong)
    assert held.watches[0]["hold_limit"] == pytest.approx(1.5 * reach.weight[0] + reach.friction[0])
    assert [one["hold_limit"] < 100.0 for one in held.watches] == [True] * 4


def test_instruments_of_each_joint(robot):
    """Drives and second encoders are watched where they are; a sensor is left out where both vouch for the motion."""
    poor = Instruments()
    rich = Instruments(encoder_resolution=1e-3, joint_encoder=True, joint_tolerance=0.1, drive=True, drive_limit=20.0,
                       force_range=9.0, emg_range=30.0, drive_gain_error=0.02, drive_offset=0.03)  # fmt: skip
    law = tree_laws.carried(robot, instruments=[poor, rich, rich, poor])
    assert law.instruments == (poor, rich, rich, poor)
    for k, watch in enumerate(law.watches):
        own, effort = (poor, rich, rich, poor)[k], law.shares[k]["effort_limit"]
        assert watch["drive_expected"] == watch["joint_expected"] == float(own is rich)
        assert watch["encoder_resolution"] == (1e-3 if own is rich else 4e-4)
        assert watch["joint_tolerance"] == own.joint_tolerance
        assert (watch["drive_limit"], watch["drive_gain"]) == (own.drive_limit, own.drive_gain_error)
        assert watch["drive_offset"] == pytest.approx(0.03 if own is rich else 0.01 * effort)
        assert watch["drive_delay"] == pytest.approx(0.013 if own is rich else math.inf)
    assert law.whole_watch["trusts_motion"] == 0.0
    for only in ({"drive": True}, {"joint_encoder": True}, {"drive": True, "joint_encoder": True}):
        found = tree_laws.carried(robot, instruments=Instruments(**only))
        assert found.whole_watch["trusts_motion"] == float(len(only) == 2)
    with pytest.raises(PellucidError, match="instruments: found 2, expected 4"):
        tree_laws.carried(robot, instruments=[poor, rich])
    slow = tree_laws.carried(robot, instruments=rich, period=0.02)
    watch = slow.watches[1]
    assert (watch["freeze_samples"], watch["test_rest"], watch["residual_slow"]) == (2.0, 5.0, 2.5)
    assert (watch["drive_delay"], watch["drive_delay_smoothing"], watch["drive_delay_forget"]) == pytest.approx(
        (0.032, 10.0, 0.4)
    )
    assert slow.whole_watch["wrench_quiet_samples"] == 2.0
    assert tree_laws.carried(robot, period=4e-3).whole_watch["wrench_quiet_samples"] == 12.0
    slowest = tree_laws.carried(robot, instruments=rich, period=0.08)  # two periods at least
    assert (slowest.watches[0]["test_rest"], slowest.watches[0]["freeze_samples"]) == (2.0, 2.0)
    assert slowest.whole_watch["wrench_quiet_samples"] == 2.0
    led = tree_laws.with_emg(slowest, "elbow", Segment(1.5, 0.15, 0.06))
    assert led.watches[3]["muscle_quiet_samples"] == 2.0


def test_thresholds_of_force_sensors(robot):
    """By friction at rest and limits of effort, at joints or on a link."""
    law = tree_laws.carried(robot, instruments=Instruments(force_range=25.0))
    reach = tree_laws.reach_of(robot)
    np.testing.assert_allclose(reach.resting, 0.3 + 0.05 * reach.weight)
    np.testing.assert_allclose(reach.coupled, COUPLED, rtol=1e-9)
    felt = tree_laws.with_force_sensor(law)
    for share in felt.shares:
        assert (share["proportional"], share["sensor_lowpass"], share["sensor_drift"]) == (2.0, 15.0, 0.1)
        assert share["feedback_limit"] == pytest.approx(0.2 * share["effort_limit"])
    driven = tree_laws.transparent(robot)
    for share, plain in zip(tree_laws.with_force_sensor(driven).shares, driven.shares, strict=True):
        assert share["energy_store"] == pytest.approx((2.0 + 2.0) * plain["energy_store"])
        assert 0.0 < plain["inertia_share"] <= 0.4
    for k, watch in enumerate(felt.watches):
        effort = law.shares[k]["effort_limit"]
        assert (watch["force_expected"], watch["force_range"], watch["force_quiet_samples"]) == (1.0, 25.0, 50.0)
        assert watch["force_tolerance"] == pytest.approx(0.5 * reach.resting[k] + 0.02 * effort)
        assert watch["force_burst"] == pytest.approx(0.15 * effort)
        assert watch["force_scale"] == pytest.approx(reach.resting[k])
    assert (felt.whole_watch["wrench_expected"], felt.whole_watch["force_excess"]) == (0.0, tree_laws.FORCE_LOUDNESS)
    hand = tree_laws.with_force_sensor(law, body="forearm")
    assert [watch["force_expected"] for watch in hand.watches] == [0.0] * 4
    assert hand.whole["sensor_link"] == robot.bodies.index("forearm") + 1
    assert hand.whole_watch["wrench_expected"] == 1.0
    both = tree_laws.with_force_sensor(law, body="forearm", at_joints=("flexion",))
    assert [watch["force_expected"] for watch in both.watches] == [0.0, 1.0, 0.0, 0.0]
    with pytest.raises(PellucidError, match="found the joint 'hand'"):
        tree_laws.with_force_sensor(law, at_joints=("hand",))
    smooth = with_joint_numbers(robot, **dict.fromkeys(
        ("coulomb_positive", "coulomb_negative", "load_motoring", "load_generating"), 0.0))  # fmt: skip
    assert tree_laws.with_force_sensor(tree_laws.carried(smooth)).watches[0]["force_scale"] == math.inf
    led = tree_laws.with_emg(law, "elbow", Segment(1.5, 0.15, 0.06))
    assert [watch["muscle_expected"] for watch in led.watches] == [0.0, 0.0, 0.0, 1.0]
    assert (led.watches[3]["muscle_range"], led.watches[3]["muscle_quiet_samples"]) == (40.0, 50.0)


def test_the_wave_of_each_joint_at_start_up(robot):
    """It moves the heaviest posture, and may do the work of the lightest; what was commissioned counts alone."""
    law, reach = tree_laws.carried(robot, start_up=True), tree_laws.reach_of(robot)
    assert np.all(reach.heaviest >= reach.inertia)
    assert np.all(reach.coupled >= reach.heaviest)
    for k, (watch, share) in enumerate(zip(law.watches, law.shares, strict=True)):
        wave = start_up_wave(
            reach.heaviest[k],
            reach.resting[k],
            4e-4,
            limit=share["effort_limit"],
            rate=share["rate_limit"],
            period=1e-3,
        )
        assert (watch["test_effort"], watch["test_samples"], watch["test_least"]) == pytest.approx(
            (wave.effort, wave.samples, wave.least)
        )
        most = 2.5 * 2.0 * (wave.effort * wave.samples * 1e-3 / math.pi) ** 2 / reach.inertia[k]
        assert watch["test_most"] == pytest.approx(most)
    known = tree_laws.carried(robot, start_up=True, instruments=Instruments(start_up_answer=0.01))
    assert (known.watches[2]["test_least"], known.watches[2]["test_most"]) == pytest.approx((0.002, 0.0175))


def test_offsets_count_by_their_size_and_an_end_that_does_not_move_has_no_limit(robot):
    reach = tree_laws.reach_of(robot)
    for offset in (-0.5, 0.5):
        more = tree_laws.reach_of(with_joint_numbers(robot, offset=offset))
        np.testing.assert_allclose(more.friction, reach.friction + 0.5)
    still = tree_laws.carried(robot, end="yoke")
    assert (still.whole["speed_limit"], still.whole["end_link"]) == (math.inf, 1.0)


def test_a_transparent_law_of_several_joints_may_speed_up_each_of_them_alone(robot):
    law = tree_laws.transparent(robot)
    stores = 0.5 * tree_laws.reach_of(robot).inertia * 2.0**2
    assert [share["energy_store"] for share in law.shares] == pytest.approx(list(stores))


def test_as_many_links_as_the_core_has_room_for(robot, monkeypatch):
    assert tree_laws.MOST_LINKS == 12
    monkeypatch.setattr(tree_laws, "MOST_LINKS", 4)
    assert len(tree_laws.carried(robot).watches) == 4
    monkeypatch.setattr(tree_laws, "MOST_LINKS", 3)
    with pytest.raises(PellucidError, match="found 4 links, expected at most 3"):
        tree_laws.carried(robot)


def test_laws_of_several_joints_that_are_refused(robot):
    with pytest.raises(PellucidError, match="found the body 'hand'"):
        tree_laws.carried(robot, end="hand")
    with pytest.raises(PellucidError, match="limits: found 1, expected 4"):
        tree_laws.carried(robot, limits=[Limits()])
