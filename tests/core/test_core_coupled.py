"""A motor, an orthosis and a limb: against plain Python, losing energy, and giving the strap back from one side."""

import re

import coupled_reference as reference
import numpy as np
import pytest

from pellucid import _core

SETTINGS = dict(period=2e-3, substeps=10, delay=1, torque_span=3)


def play(plant, desired, muscle, jumps=None, base=None):
    """Outputs by name, from the start to the end of the last period."""
    rows = [plant.read()]
    jumps, base = (np.zeros(len(desired)) if x is None else x for x in (jumps, base))
    for inputs in zip(desired.tolist(), muscle.tolist(), jumps.tolist(), base.tolist(), strict=True):
        rows.append(plant.step(*inputs))
    return dict(zip(reference.OUTPUTS, np.array(rows).T, strict=True))


def signals(n, rng):
    t = 2e-3 * np.arange(n)
    desired = 4 * np.sin(3 * t) + 2 * np.sign(np.sin(17 * t))
    jumps = np.zeros(n)
    jumps[n // 2] = 0.1
    return desired, 5 * np.sin(5 * t + 1) + 3 * rng.standard_normal(), jumps, 4 * np.sin(11 * t) * (t > 0.3)


def test_names():
    assert _core.COUPLED_PARAMETER_NAMES == reference.NAMES


@pytest.mark.parametrize("delay", [0, 1, 7])
def test_plant_is_that_of_python(delay, rng):
    """Random plants whose motor sticks, slips and saturates, whose strap goes slack, creeps and jumps.

    The two round differently, and a stop may then fall in another substep: so 1e-7, not 1e-12.
    """
    stuck = slipped = slack = limited = 0
    for _ in range(8):
        p = reference.random_parameters(rng)
        inputs = signals(500, rng)
        settings = SETTINGS | dict(delay=delay, position0=rng.uniform(-0.2, 0.8), torque0=rng.uniform(-2, 2))
        core, plain = _core.CoupledPlant(p, **settings), reference.Plant(p, **settings)
        got, wanted = play(core, *inputs), play(plain, *inputs)
        for name in reference.OUTPUTS:
            scale = max(1.0, np.max(np.abs(wanted[name])))
            np.testing.assert_allclose(got[name], wanted[name], rtol=0, atol=1e-7 * scale, err_msg=name)
        assert core.slip == pytest.approx(plain.slip, abs=1e-7)
        stuck += np.count_nonzero(np.diff(got["motor_position"]) == 0)
        slipped += abs(core.slip) > 0.11
        slack += np.count_nonzero(got["strap_torque"] == 0)
        limited += np.count_nonzero(np.abs(got["motor_torque"]) == p[reference.NAMES.index("motor_limit")])
    assert stuck > 20
    assert slipped > 0
    assert slack > 5
    assert limited > 5


@pytest.mark.parametrize(
    "changes",
    [
        {"presliding_travel": 2e-3},
        {"strap_stiffness": 0.0, "strap_damping": 0.0},
        {"strap_mobility": 0.0},
        {"passive_scale": 0.0, "passive_torque": 0.0},
        {"viscous_decline": 0.0},
        {"stribeck": 0.0, "load_rise": 0.0},
        {"friction_swing": 0.0},
        {"bearing_coulomb": 0.0, "bearing_viscous": 0.0},
        {"gravity_sine": 0.0, "gravity_cosine": 0.0},
        {"spring_damping": 0.0},
    ],
    ids=lambda changes: "+".join(changes),
)
def test_terms_that_are_left_out_are_zero(changes, rng):
    inputs = signals(300, rng)
    p = reference.parameters(**changes)
    plain = reference.parameters(**(changes | ({"passive_scale": 1.0} if "passive_scale" in changes else {})))
    got = play(_core.CoupledPlant(p, **SETTINGS), *inputs)
    for name, wanted in play(reference.Plant(plain, **SETTINGS), *inputs).items():
        np.testing.assert_allclose(got[name], wanted, rtol=0, atol=1e-8 * max(1.0, np.max(np.abs(wanted))))


FREE = dict(torque_kp=0.0, torque_ki=0.0, torque_kd=0.0, strap_mobility=0.0, strap_relaxing_stiffness=0.0)
"""What its outputs show all the energy of."""


def energy(p, out, motor):
    """Of three bodies, the spring, the strap, and gravity."""
    p = dict(zip(reference.NAMES, p, strict=True))
    q_e, q_k = out["orthosis_position"], out["limb_position"]
    off, at = (p["strap_along"] * np.sin(q) - p["strap_across"] * np.cos(q) for q in (q_e, p["strap_fitted"]))
    strap = np.maximum(np.abs(q_k - q_e - off + at) - 0.5 * max(p["strap_slack"], 0.0), 0.0)
    hardens = 1 / (6 * p["strap_hardening"] ** 2) if p["strap_hardening"] > 0 else 0.0
    velocity = np.gradient(motor, 2e-3)
    kinetic = p["motor_inertia"] * velocity**2 + p["orthosis_inertia"] * out["orthosis_velocity"] ** 2
    stored = p["spring_stiffness"] * (motor - q_e) ** 2 + p["strap_stiffness"] * strap**2 * (1 + hardens * strap**2)
    weight = p["gravity_sine"] * np.cos(q_e) - p["gravity_cosine"] * np.sin(q_e)
    weight = weight + p["limb_gravity"] * np.cos(q_k - p["limb_centre"])
    tissue = p["passive_torque"] * p["passive_scale"] * np.exp((p["passive_angle"] - q_k) / p["passive_scale"])
    return 0.5 * (kinetic + p["limb_inertia"] * out["limb_velocity"] ** 2 + stored) - weight + tissue


def test_energy_only_falls(rng):
    """No motor: friction and damping take energy; the motor's encoder stands for its angle, hence the margin."""
    for _ in range(10):
        p = reference.random_parameters(rng, **FREE, motor_quantum=1e-9, output_quantum=1e-9)
        plant = _core.CoupledPlant(p, period=2e-3, substeps=200, position0=rng.uniform(0.4, 1.2), torque0=3.0)
        out = play(plant, np.zeros(1500), np.zeros(1500))
        e = energy(p, out, out["motor_position"])[2:-2]
        assert np.max(np.diff(e)) < 2e-3 * np.ptp(e)
        assert e[-1] < e[0] - 0.1


def test_nothing_lost_nothing_gained():
    """Without friction and damping the energy stays, end of the range and slack strap included."""
    nothing = dict.fromkeys(
        ("coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative", "stribeck", "load_motoring",
         "load_generating", "square_root", "spring_damping", "bearing_coulomb", "bearing_viscous", "strap_damping",
         "limb_viscous"),
        0.0,
    )  # fmt: skip
    p = reference.parameters(
        **nothing,
        **FREE,
        strap_slack=0.05,
        strap_hardening=0.1,
        strap_across=0.1,
        strap_along=-0.15,
        strap_fitted=0.4,
        motor_quantum=1e-9,
        output_quantum=1e-9,
    )
    plant = _core.CoupledPlant(p, period=2e-3, substeps=400, position0=0.8, torque0=1.0)
    out = play(plant, np.zeros(2000), np.zeros(2000))
    e = energy(p, out, out["motor_position"])[2:-2]
    assert np.count_nonzero(np.diff(np.sign(out["strap_torque"]))) > 10
    assert out["limb_position"].min() < -0.05
    assert np.ptp(e) < 0.01


def test_strap_follows_from_either_side(rng):
    """What is left of the orthosis's balance is the strap's torque, and so is what is left of the limb's."""
    p = reference.parameters(bearing_coulomb=0.0, strap_mobility=0.0, motor_quantum=1e-9, output_quantum=1e-9)
    values = dict(zip(reference.NAMES, p, strict=True))
    muscle = 5 + 2 * np.sin(4 * 1e-4 * np.arange(30_000))
    out = play(_core.CoupledPlant(p, period=1e-4, substeps=10, position0=0.3), np.zeros(30_000), muscle)
    inner = slice(50, -50)

    def acceleration(velocity):
        return np.gradient(velocity, 1e-4)[inner]

    q_e, v_e = out["orthosis_position"][inner], out["orthosis_velocity"][inner]
    q_k, v_k = out["limb_position"][inner], out["limb_velocity"][inner]
    weight = values["gravity_sine"] * np.sin(q_e) + values["gravity_cosine"] * np.cos(q_e)
    of_orthosis = values["orthosis_inertia"] * acceleration(out["orthosis_velocity"]) + weight
    of_orthosis += values["bearing_viscous"] * v_e - out["spring_torque"][inner]
    tissue = values["passive_torque"] * np.exp((values["passive_angle"] - q_k) / values["passive_scale"])
    of_limb = 0.5 * (muscle[49:-50] + muscle[50:-49])[: len(q_k)] + tissue - values["limb_viscous"] * v_k
    of_limb -= values["limb_inertia"] * acceleration(out["limb_velocity"])
    of_limb -= values["limb_gravity"] * np.sin(q_k - values["limb_centre"])
    design = np.column_stack([q_k - q_e, v_k - v_e])
    for torque in (of_orthosis, of_limb):
        stiffness, damping = np.linalg.lstsq(design, torque, rcond=None)[0]
        assert stiffness == pytest.approx(values["strap_stiffness"], rel=0.01)
        assert damping == pytest.approx(values["strap_damping"], rel=0.05)


def test_zero_impedance_gives_way():
    """The loop divides what friction and the rotor resist by one plus its gain."""
    rms = []
    for gain in (0.0, 2.0):
        p = reference.parameters(torque_kp=gain, torque_ki=0.0, torque_kd=0.01)
        out = play(
            _core.CoupledPlant(p, **SETTINGS, position0=0.3), np.zeros(4000), 6 * np.sin(5 * 2e-3 * np.arange(4000))
        )
        assert np.ptp(out["limb_position"]) > 0.5
        rms.append(np.sqrt(np.mean(out["torque"] ** 2)) / np.std(out["orthosis_velocity"]))
    assert rms[1] < rms[0] / 2.2


def test_slip_jumps_and_stays():
    p = reference.parameters(strap_mobility=0.0)
    plant = _core.CoupledPlant(p, **SETTINGS)
    plant.step(0.0, 0.0, 0.2)
    plant.step(0.0, 0.0)
    assert plant.slip == 0.2


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308])
def test_bad_numbers_end(value):
    for i in range(len(reference.NAMES)):
        p = reference.parameters()
        p[i] = value
        plant = _core.CoupledPlant(p, **SETTINGS)
        for _ in range(5):
            assert len(plant.step(1.0, 1.0)) == len(reference.OUTPUTS)
    plant = _core.CoupledPlant(reference.parameters(), **SETTINGS)
    plant.step(value, 0.0)
    plant.step(0.0, value, value)


@pytest.mark.parametrize("name", ["limb_inertia", "strap_stiffness", "spring_damping", "coulomb_positive", "torque_kp"])
def test_nan_is_seen_in_the_results(name):
    plant = _core.CoupledPlant(reference.parameters(**{name: np.nan}), **SETTINGS)
    for _ in range(20):
        out = plant.step(20.0, 5.0)
    assert np.isnan(out[3])


P = reference.parameters()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(parameters=P[:21]), "parameters: got shape (21,), expected (48,)"),
        (dict(period=0.0), "period: expected a number of seconds above 0"),
        (dict(period=np.nan), "period: expected a number of seconds above 0"),
        (dict(substeps=0), "substeps: expected a whole number from 1 to 1000000"),
        (dict(delay=8), "delay: expected a whole number from 0 to 7"),
        (dict(torque_span=0), "torque_span: expected a whole number from 1 to 7"),
        (dict(delay=1.5), "delay: expected a whole number from 0 to 7"),
    ],
)
def test_misuse(changes, message):
    arguments = dict(parameters=P) | SETTINGS | changes
    with pytest.raises(ValueError, match=re.escape(message)):
        _core.CoupledPlant(arguments.pop("parameters"), **arguments)
