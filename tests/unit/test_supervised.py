"""A law under its supervisor: thresholds by rule, healthy runs to the bit, faults, resets, and the list of faults."""

import numpy as np
import pytest

import pellucid as pl
from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.supervised import supervised
from pellucid.models.fields import model_fields
from pellucid_lab.safety.fault_table import FAULT_KINDS

NUMBERS = {
    "inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "coulomb_positive": 0.3, "coulomb_negative": 0.3,
    "effort_limit": 5.0, "rate_limit": 500.0, "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0,
    "stop_margin": 0.1, "max_age": 0.005, "max_repeats": 2.0, "period": 0.001,
}  # fmt: skip


def joint():
    return ControlLaw("joint", LAWS["joint"].defaults | NUMBERS)


def held(safe, steps, start=0, **given):
    """A joint that is held still, whose drive does as it is told."""
    for i in range(start, start + steps):
        drive = {"drive": safe._running.effort} if safe.supervision["drive_expected"] else {}
        safe.step(1e-3 * i, 0.5, **{**drive, **given})
    return safe


def test_thresholds_follow_from_the_law():
    s = pl.supervised(joint(), instruments=Instruments(drive=True)).supervision
    assert set(s) == {field.name for field in model_fields("supervisor")}
    assert (s["raw_speed_limit"], s["range_max"]) == (10.0, pytest.approx(2.15))
    assert (s["push_limit"], s["ringing_limit"]) == (5.0, pytest.approx(0.69))
    assert s["raw_acceleration_limit"] == pytest.approx(5.0 / (0.1 * 0.05))
    assert s["test_effort"] == pytest.approx(0.3 + 50.0 * 0.05)
    assert 2.0 * s["test_effort"] * s["test_samples"] * 2e-3 / np.pi < 0.2  # N m s, of the whole wave
    bare = pl.supervised(joint(), body=dict.fromkeys(("inertia", "gravity_sine", "gravity_cosine", "offset", "coulomb",
                                                      "load", "viscous"), 0.0)).supervision  # fmt: skip
    assert np.isinf(bare["wearer_torque"])
    assert bare["test_effort"] == 0.0
    with pytest.raises(PellucidError, match="found no number, or one too many, for guess"):
        pl.supervised(joint(), guess=1.0)


def test_a_healthy_run_is_the_laws_own_to_the_bit():
    law, safe = joint(), supervised(joint(), start_up=False)
    t = 1e-3 * np.arange(3000)
    q = 0.5 + 0.4 * np.sin(1.5 * t)
    assert [safe.step(*now) for now in zip(t, q, strict=True)] == list(law.run(t, q))
    assert (safe.mode, safe.fault, safe.challenge, safe.log) == ("running", "none", 0, [])


def test_a_fault_takes_the_power_and_only_an_operator_gives_it_back():
    safe = held(supervised(joint(), instruments=Instruments(drive=True), start_up=False, reset_delay=0.05,
                           healthy_samples=20.0), 100)  # fmt: skip
    assert safe.enable
    held(safe, 5, 100, drive=4.0)
    assert (safe.fault, safe.enable) == ("drive_stuck", False)
    held(safe, 200, 105)
    assert safe.mode == "latched"
    challenge = safe.challenge
    held(safe, 200, 305, token=challenge ^ 2)
    assert safe.fault == "drive_stuck"
    held(safe, 2, 505, token=challenge)
    assert (safe.fault, safe.enable) == ("none", True)
    assert [fault for _, fault, _ in safe.log] == ["drive_stuck"]


@pytest.mark.parametrize(
    ("late", "gain", "fault"),
    [(0.0, 0.0, "drive_effort"), (0.024, 0.0, "none"), (0.0, 0.5, "drive_effort"), (0.024, 0.5, "drive_effort")],
)
def test_a_slow_torque_loop_is_held_to_what_it_was_asked_for_a_while_ago(late, gain, fault):
    """A command that turns with the motion, as a strap's end makes it: a drive that follows late adds energy, and so
    does one that gives more than it was asked for."""
    law = ControlLaw("joint", LAWS["joint"].defaults | NUMBERS | {"gravity_sine": -3.0})
    safe = supervised(law, instruments=Instruments(drive=True), start_up=False, drive_tolerance=np.inf,
                      wearer_torque=np.inf, wearer_push=np.inf, push_limit=np.inf, power_limit=np.inf,
                      budget_store=np.inf, ringing_limit=np.inf, shaking_limit=np.inf, drive_delay=np.inf,
                      drive_late=np.exp(-1e-3 / late) if late else 0.0)  # fmt: skip
    given, left = 0.0, np.exp(-1e-3 / 0.024)
    for i in range(2000):
        t = 1e-3 * i
        safe.step(t, 0.5 + 0.3 * (1.0 - np.cos(4.0 * np.pi * t)), drive=(1.0 + gain) * given)
        given = safe._running.effort + left * (given - safe._running.effort)
    assert safe.fault == fault


def test_a_law_goes_on_without_a_sensor_that_it_can_do_without():
    values = LAWS["transparent"].defaults | {n: x for n, x in NUMBERS.items() if n in LAWS["transparent"].defaults}
    law = ControlLaw("transparent", values).using("muscle")
    safe = supervised(law, start_up=False)
    for i in range(100):
        safe.step(1e-3 * i, 0.5, None, 1e-3 * (i % 7))
    assert safe.mode == "running"
    for i in range(100, 200):
        safe.step(1e-3 * i, 0.5, None, None)
    assert (safe.mode, safe.fault, safe.enable) == ("degraded", "lost", True)
    assert [entry[1:] for entry in safe.log] == [("lost", "degraded")]


@pytest.mark.parametrize("gap", [0.2, 1.5])
def test_a_joint_at_rest_can_be_reset_after_its_encoder_was_silent(gap):
    """What it moved in the gap counted as the velocity of one period, after which rest was a frozen encoder."""
    safe = held(supervised(joint(), start_up=False), 100)
    silent = 100 + round(1e3 * gap)
    for i in range(100, silent):
        safe.step(1e-3 * i, None)
    assert (safe.fault, safe.enable) == ("not_finite", False)
    for i in range(silent, silent + 2000):
        safe.step(1e-3 * i, 0.3, token=safe.challenge)
    assert (safe.fault, safe.mode) == ("none", "running")


def test_a_joint_that_does_not_answer_has_no_polarity():
    safe = held(supervised(joint()), 99)
    assert safe.mode == "start_up"
    held(safe, 200, 99)
    assert (safe.fault, safe.mode) == ("polarity", "latched")


def test_a_stop_holds_what_carries_weight():
    safe = held(supervised(joint(), start_up=False), 100)
    safe.stop()
    place, efforts = 0.5, []
    for i in range(100, 400):
        place -= 3e-4
        efforts.append(safe.step(1e-3 * i, place))
    assert (safe.mode, safe.fault, safe.enable) == ("damped_stop", "stopped", True)
    assert efforts[-1] == pytest.approx(0.3 * safe.supervision["hold_damping"], rel=0.05)


@pytest.mark.parametrize("law", ["joint", "transparent"])
def test_nonsense_and_broken_memory_give_nothing_unsafe(law):
    values = LAWS[law].defaults | {name: x for name, x in NUMBERS.items() if name in LAWS[law].defaults}
    safe = supervised(ControlLaw(law, values), instruments=Instruments(drive=True), start_up=False,
                      reset_delay=0.02, healthy_samples=20.0)  # fmt: skip
    unsafe, faults, moving, _ = _core.fuzz_supervised(safe.kind, safe.parameters, safe.supervisor, 200_000, 3)
    assert unsafe == 0
    assert faults > 10
    assert moving > 1000


def test_from_a_study_to_a_supervised_law(make_study):
    study = make_study()
    found = pl.identify(study, families=["symmetric"], thorough=False)
    law = pl.controller(found, limits=pl.Limits(effort=5.0, rate=500.0, velocity=10.0, position=(-2.0, 2.0)))
    assert law.values == pl.controller(found.cards["joint"], limits=pl.Limits(5.0, 500.0, 10.0, (-2.0, 2.0))).values
    safe = held(pl.supervised(law, start_up=False), 100)
    assert (safe.mode, safe.enable) == ("running", True)
    with pytest.raises(PellucidError, match="found Study, expected what `identify` found of a joint"):
        pl.controller(study)


@pytest.mark.parametrize(("frequency", "fault"), [(0.35, "none"), (2.5, "shaking")])
def test_a_joint_that_goes_to_and_fro_for_seconds_loses_its_power(frequency, fault):
    """At the same peak speed of 1.4 rad/s, as fast as a hand reaches to and fro, and as fast as a wearer shakes."""
    law = ControlLaw("joint", LAWS["joint"].defaults | NUMBERS)
    free = dict.fromkeys(("wearer_torque", "wearer_push", "push_limit", "power_limit", "budget_store"), np.inf)
    watched = Instruments(shaking=True)
    safe = supervised(law, instruments=watched, start_up=False, ringing_limit=np.inf, **free)
    rate = 2.0 * np.pi * frequency
    for i in range(5000):
        safe.step(1e-3 * i, 0.5 + 1.4 * (1.0 - np.cos(rate * 1e-3 * i)) / rate)
    assert (safe.fault, safe.enable) == (fault, fault == "none")


def test_faults_are_listed_once_and_said_in_words():
    names = [kind.name for kind in FAULT_KINDS]
    assert len(names) == len(set(names)) >= 20
    assert {kind.group for kind in FAULT_KINDS} == {"sensor", "drive", "wearer", "clock", "software"}
    assert all(kind.sentence for kind in FAULT_KINDS)
