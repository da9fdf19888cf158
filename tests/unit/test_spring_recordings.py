"""Springs on the bench, such as series-elastic elements with a locked end: a protocol of its own."""

import numpy as np
import pytest

import pellucid as pl
from pellucid.joint.study.spring_recordings import spring_page

STIFFNESS, DAMPING, HYSTERESIS, INERTIA, GAIN = 170.0, 0.6, 0.25, 0.004, 2.0  # SI; of the study's drive [N*m/A]
PROTOCOL = ('protocol = "multisine"', 'protocol = "locked_spring"')
HELD_OUT = """
[[recordings]]
name = "judged"
file = "recordings/judged.csv"
use = "validate"
protocol = "locked_spring"
"""


def deflected(rng, speed=1.0, hardening=0.0, count=4000):
    """Time, deflection and current of a spring whose hysteresis is a Dahl bristle, which no column of the fit is."""
    t = np.arange(count) / 200.0
    waves = ((0.05, 0.3, 0.0), (0.02, 1.1, 1.0), (0.004, 3.7, 2.0))
    q = sum(a * np.sin(2.0 * np.pi * f * speed * t + phase) for a, f, phase in waves)
    v, bend = np.gradient(q, t), np.zeros(count)
    for i in range(1, count):
        step = q[i] - q[i - 1]
        bend[i] = np.sign(step) - (np.sign(step) - bend[i - 1]) * np.exp(-abs(step) / 5e-4)
    torque = STIFFNESS * q * (1.0 + hardening * q**2) + DAMPING * v + HYSTERESIS * bend + INERTIA * np.gradient(v, t)
    torque += 0.02 + 0.03 * rng.standard_normal(count)
    return {"t": t, "q": q + 2e-6 * rng.standard_normal(count), "i": torque / GAIN}


@pytest.fixture
def spring(make_study, rng):
    def make(**options):
        study = make_study(deflected(rng, **options), PROTOCOL, append=HELD_OUT)
        judged = deflected(rng, speed=1.3, **options)
        path = study.folder / "recordings/judged.csv"
        np.savetxt(path, np.column_stack(list(judged.values())), delimiter=",", header=",".join(judged), comments="")
        return study

    return make


def test_stiffness_damping_and_hysteresis_of_a_locked_spring(spring):
    study = spring()
    assert not [fault for fault in pl.check(study) if fault.severity in ("refuse", "cut")]
    found = pl.identify(study)
    for name, true in (("stiffness", STIFFNESS), ("damping", DAMPING), ("hysteresis", HYSTERESIS)):
        low, high = found[name].interval()
        assert low < true < high, name
    assert found["stiffness"].value == pytest.approx(STIFFNESS, rel=0.005)
    assert found["hysteresis"].value == pytest.approx(HYSTERESIS, rel=0.15)
    assert found["stiffness"].standard_error < 0.01 * STIFFNESS
    assert found.fit.is_linear
    assert found.headline.startswith("a spring of 1")
    assert [v.kind for v in found.verdicts] == ["good"]
    assert [row.split for row in found.rows if ".effort_error." in row.id] == ["fitted", "heldout"]
    # The drive's current was recorded, so that its torque is not a measured one.
    loop = spring_page(study, found).figure
    assert loop is not None
    assert "(held out): computed (black" in loop.caption
    assert "measured" not in loop.caption + loop.svg


def test_a_spring_that_hardens_is_said_to(spring):
    found = pl.identify(spring(hardening=60.0))
    assert not found.fit.is_linear
    assert found["stiffness"].value == pytest.approx(STIFFNESS, rel=0.03)
    assert found["cubic_stiffness"].value == pytest.approx(60.0 * STIFFNESS, rel=0.2)
    assert any("hardens" in v.text for v in found.verdicts)
    assert found.fit.effort_error < 0.9 * found.fit.linear_error


def test_a_pendulum_is_said_to_be_no_spring_and_one_speed_is_refused(make_study):
    found = pl.identify(make_study(make_study.swing(), PROTOCOL))
    assert any(v.kind in ("wrong", "note") for v in found.verdicts)
    t = np.arange(4000) / 200.0
    once = {"t": t, "q": 0.05 * np.sin(2.0 * t), "i": 4.0 * np.sin(2.0 * t) + 0.01 * np.cos(2.0 * t)}
    study = make_study(once, PROTOCOL)
    (fault,) = [fault for fault in pl.check(study) if fault.severity == "refuse"]
    assert "deflect the spring in both directions, at two or more speeds" in fault.message


def test_a_dynamometer_shows_weight_and_friction_and_its_inertia_is_no_surprise(make_study, rng):
    """A machine that turns a joint at constant speeds, there and back: its torque is the drive's."""
    weight, dry, slick, inertia = 3.0, 0.4, 0.15, 0.08
    speed = np.repeat([0.3, -0.3, 0.8, -0.8, 1.4, -1.4] * 2, [700, 700, 260, 260, 150, 150] * 2)
    v = np.convolve(speed, np.ones(21) / 21.0, "same")
    t = np.arange(len(v)) / 200.0
    q = -1.0 + (np.cumsum(v) - 0.5 * v) / 200.0  # without the half sample by which a sum is ahead
    torque = inertia * np.gradient(v, t) + weight * np.sin(q) + dry * np.tanh(v / 0.01) + slick * v
    torque += 0.02 * rng.standard_normal(len(t))
    study = make_study({"t": t, "q": q + 1e-5 * rng.standard_normal(len(t)), "i": torque / GAIN})
    assert not [fault for fault in pl.check(study) if fault.severity in ("refuse", "cut")]
    found = pl.identify(study, families=["symmetric"], thorough=False)
    for name, true in (("gravity", weight), ("coulomb", dry), ("viscous", slick)):
        low, high = found[name].interval()
        assert low < true < high, name
        assert found[name].value == pytest.approx(true, rel=0.1), name
    low, high = found["inertia"].interval()
    assert low < inertia < high
