"""A motor and a link behind a compliant transmission: against plain Python, in lanes, at rest, and losing energy."""

import os
import re
import subprocess
import sys

import geared_reference as reference
import numpy as np
import pytest

from pellucid import _core

OUTPUTS = (
    "motor_position", "motor_velocity", "link_position", "link_velocity", "command", "measured_position",
    "transmission_torque",
)  # fmt: skip

LOOPS = {
    "open": dict(loop="none", gain=2.0, back_emf=0.05),
    "p limited": dict(loop="p", kp=40.0, limit=3.0),
    "pi": dict(loop="pi", kp=30.0, ki=20.0, limit=8.0, integral0=0.05),
    "pd": dict(loop="pd", kp=40.0, kd=1.0, velocity_span=3, limit=8.0),
    "cascade": dict(loop="cascade", kp=15.0, kv=3.0, ki=10.0, velocity_span=2, limit=8.0, integral0=-0.1),
    "velocity": dict(loop="velocity_pi", kp=3.0, ki=5.0, velocity_span=2, limit=6.0),
}


def run(p, **settings):
    """One row, its outputs by name."""
    rows = _core.simulate_geared(np.atleast_2d(p), **settings)
    return dict(zip(OUTPUTS, (x[0] for x in rows), strict=True))


def signals(n, rng):
    t = 1e-3 * np.arange(n)
    return dict(
        reference=0.6 * np.sin(4 * t) + 0.1 * np.sin(23 * t),
        injected=0.3 * np.sign(np.sin(31 * t)),
        disturbance=2.0 * np.sin(2 * t + 1),
        encoder_noise=1e-5 * rng.standard_normal(n),
    )


def test_names():
    assert _core.GEARED_PARAMETER_NAMES == reference.NAMES


@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS)
def test_plant_is_that_of_python(loop, rng):
    """Random joints whose motion sticks, slips, crosses the gap and (in some loops) saturates.

    The two round differently, and a contact or a stop may then fall in another substep: so 1e-7, not 1e-12.
    """
    crossings = stuck = 0
    for _ in range(6):
        p = reference.random_parameters(rng)
        settings = dict(
            period=1e-3, substeps=4, encoder_quantum=2e-4, ripple_amplitude=0.05, ripple_wave_number=14.0,
            ripple_phase=0.4, position0=rng.uniform(-0.3, 0.3), velocity0=-0.2, **loop, **signals(800, rng),
        )  # fmt: skip
        got = run(p, **settings)
        for name, wanted in zip(OUTPUTS, reference.simulate(p, **settings), strict=True):
            scale = max(1.0, np.max(np.abs(wanted)))
            np.testing.assert_allclose(got[name], wanted, rtol=0, atol=1e-7 * scale, err_msg=name)
        torque = got["transmission_torque"]
        crossings += np.count_nonzero(np.diff(np.sign(torque[torque != 0])))
        stuck += np.count_nonzero(got["motor_velocity"] == 0)
    assert crossings > 0
    assert stuck > 50


def test_contacts_that_give_are_those_of_python(rng):
    """Random joints whose friction builds up over up to 5 mrad: nothing sticks, and every term is still there."""
    bent = 0
    for travel in (3e-4, 1e-3, 5e-3):
        p = reference.random_parameters(rng, presliding_travel=travel)
        settings = dict(
            period=1e-3, substeps=8, loop="cascade", kp=15.0, kv=3.0, ki=10.0, velocity_span=2, limit=8.0,
            encoder_quantum=2e-4, back_emf=0.05, **signals(800, rng),
        )  # fmt: skip
        got = run(p, **settings)
        for name, wanted in zip(OUTPUTS, reference.simulate(p, **settings), strict=True):
            scale = max(1.0, np.max(np.abs(wanted)))
            np.testing.assert_allclose(got[name], wanted, rtol=0, atol=1e-7 * scale, err_msg=name)
        assert np.all(got["motor_velocity"][1:] != 0)
        stuck = run(p * (np.array(reference.NAMES) != "presliding_travel"), **settings)
        bent += np.max(np.abs(stuck["motor_position"] - got["motor_position"])) > 1e-4
    assert bent == 3


def test_a_push_below_slip_bends_contacts_along_their_curve():
    """A motor in the gap under a slow push: it yields by travel (1 - sqrt(1 - push / level)), and slips from there."""
    travel, level = 2e-3, 0.4
    nothing = dict.fromkeys(reference.NAMES, 0.0)
    p = nothing | dict(
        link_inertia=1e6, motor_inertia=0.05, stiffness=100.0, backlash=0.2, presliding_travel=travel,
        coulomb_positive=level, coulomb_negative=level, viscous_positive=5.0, viscous_negative=5.0,
    )  # fmt: skip
    share = np.concatenate([np.linspace(0, 0.75, 4000), np.full(1000, 0.75)])
    moved = run([p[n] for n in reference.NAMES], reference=level * share, period=1e-3, substeps=20)["motor_position"]
    assert moved[-1] == pytest.approx(0.5 * travel, rel=0.01)
    np.testing.assert_allclose(moved, travel * (1 - np.sqrt(1 - share)), atol=0.02 * travel)
    back = np.concatenate([share, 0.75 - share])
    loop = run([p[n] for n in reference.NAMES], reference=level * back, period=1e-3, substeps=20)["motor_position"]
    # Turned back it gives half as readily: twice the way for twice the change, Masing's rule.
    assert loop[-1] == pytest.approx(travel * (0.5 - 2 * (1 - np.sqrt(1 - 0.375))), abs=0.01 * travel)


def test_a_travel_too_small_to_be_one_leaves_every_bit(rng):
    p, small = reference.random_parameters(rng), reference.NAMES.index("presliding_travel")
    settings = dict(period=1e-3, substeps=4, loop="p", kp=40.0, **signals(500, rng))
    without = run(p, **settings)
    p[small] = 9e-10
    assert all(np.array_equal(without[name], x) for name, x in run(p, **settings).items())


def test_contacts_give_no_more_than_they_took(rng):
    """No drive: what falls may rise again by what contacts store, at most half their level times the travel."""
    for _ in range(5):
        p = reference.random_parameters(
            rng, presliding_travel=3e-3, load_motoring=0.0, load_generating=0.0, stribeck=0.0, friction_swing=0.0
        )
        start = dict(position0=rng.uniform(-2, 2), velocity0=rng.uniform(-3, 3))
        e = energy(p, run(p, reference=np.zeros(2000), period=1e-3, substeps=200, **start))
        level = max(p[reference.NAMES.index(f"coulomb_{way}")] for way in ("positive", "negative"))
        assert np.max(e - np.minimum.accumulate(e)) < 0.5 * level * 3e-3 + 2e-5 * np.ptp(e)
        assert e[-1] < e[0]


@pytest.mark.parametrize(
    "changes",
    [
        {"stribeck_velocity": 0.0},
        {"stribeck": 0.0},
        {"load_rise": 0.0},
        {"stribeck": 0.0, "load_rise": 0.0},
        {"load_motoring": 0.0, "load_generating": 0.0},
        {"friction_swing": 0.0},
        {"viscous_decline": 0.0},
        {"backlash": 0.0},
        {"damping": 0.0},
        {"gravity_sine": 0.0, "gravity_cosine": 0.0},
        {"bearing_coulomb": 0.0, "bearing_viscous": 0.0},
    ],
    ids=lambda changes: "+".join(changes),
)
def test_terms_that_are_left_out_are_zero(changes, rng):
    p = reference.parameters(**changes)
    settings = dict(period=1e-3, substeps=4, loop="p", kp=40.0, **signals(500, rng))
    for got, wanted in zip(run(p, **settings).values(), reference.simulate(p, **settings), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-8 * max(1.0, np.max(np.abs(wanted))))


def test_each_term_of_the_friction():
    """One substep of a motor in the gap, or under a known torque: its deceleration is the friction, term by term."""

    def friction(q_m, v, **changes):
        nothing = dict.fromkeys(reference.NAMES, 0.0)
        p = nothing | dict(link_inertia=1e6, motor_inertia=0.5, stiffness=100.0, backlash=0.2) | changes
        out = run(
            [p[name] for name in reference.NAMES],
            reference=np.zeros(2), period=1e-3, substeps=1, position0=q_m, velocity0=v,
        )  # fmt: skip
        torque = out["transmission_torque"][0]
        return -0.5 * np.diff(out["motor_velocity"])[0] / 1e-3 - torque, torque

    assert friction(0.0, 2.0, coulomb_positive=0.3)[0] == pytest.approx(0.3)
    assert friction(0.0, -2.0, coulomb_negative=0.4)[0] == pytest.approx(-0.4)
    swing = dict(coulomb_positive=0.3, friction_swing=0.5, friction_wave_number=3.0)
    assert friction(0.2, 2.0, **swing)[0] == pytest.approx(0.3 * (1 + 0.5 * np.sin(0.6)))
    assert friction(0.0, 2.0, viscous_positive=0.3)[0] == pytest.approx(0.6)
    assert friction(0.0, 2.0, viscous_positive=0.3, viscous_decline=2.0)[0] == pytest.approx(0.3)
    stribeck = dict(stribeck=0.2, stribeck_velocity=1.0)
    assert friction(0.0, 1.0, **stribeck)[0] == pytest.approx(0.2 / np.e)
    load = dict(gravity_cosine=5.0, load_motoring=0.1, load_generating=0.2)
    assert friction(0.0, 1.0, **load) == (pytest.approx(0.5), pytest.approx(5.0))
    assert friction(0.0, -1.0, **load) == (pytest.approx(-1.0), pytest.approx(5.0))
    rise = load | dict(load_rise=0.6, stribeck_velocity=1.0)
    assert friction(0.0, 1.0, **rise)[0] == pytest.approx(0.5 * (1 + 0.6 / np.e))
    assert friction(0.0, 1.0, **load | dict(load_rise=0.6))[0] == pytest.approx(0.5)  # no v_s, no rise


def test_values_are_those_at_the_sample_instants():
    p = reference.parameters(gravity_sine=0.0, gravity_cosine=2.0)
    out = run(p, reference=[1.0, 2.0], period=1e-3, substeps=1, injected=[0.5, 0.0], position0=0.2, velocity0=0.1)
    assert (out["link_position"][0], out["link_velocity"][0], out["motor_velocity"][0]) == (0.2, 0.1, 0.1)
    weight = 2.0 * np.cos(0.2)
    assert out["motor_position"][0] == pytest.approx(0.2 + weight / 600 + 0.005, abs=1e-15)
    assert out["transmission_torque"][0] == pytest.approx(weight, rel=1e-12)
    assert out["measured_position"][0] == out["motor_position"][0]
    assert out["command"].tolist() == [1.5, 2.0]
    for body in ("motor", "link"):
        q, v = out[f"{body}_position"], out[f"{body}_velocity"]
        assert q[1] == q[0] + 1e-3 * v[1]


def settings(rng, m, n):
    t = 1e-3 * np.arange(n)
    return dict(
        reference=0.5 * np.sin(4 * t) + 0.1 * rng.standard_normal((m, 1)) * np.sin(20 * t),
        disturbance=0.2 * np.sin(11 * t), encoder_noise=1e-5 * rng.standard_normal((m, n)),
        period=1e-3, substeps=3, loop="cascade", kp=rng.uniform(5, 15, m), kv=2.0, ki=2.0, limit=6.0, velocity_span=2,
        encoder_quantum=1e-4, ripple_amplitude=rng.uniform(0, 0.1, m) * (np.arange(m) % 3 > 0),
        ripple_wave_number=12.0, position0=rng.uniform(-1, 1, m), integral0=rng.uniform(-0.1, 0.1, m),
    )  # fmt: skip


def some_rows(rng, m):
    """Some rows without some terms: what is skipped for all lanes may not change a bit."""
    p = np.array([reference.random_parameters(rng) for _ in range(m)]).reshape(m, 23)
    terms = (
        ("friction_swing",), ("viscous_decline",), ("stribeck", "load_rise"), ("stribeck_velocity",), ("backlash",),
        ("gravity_sine", "gravity_cosine"), ("load_motoring", "load_generating"), ("bearing_coulomb",),
    )  # fmt: skip
    for start, names in enumerate(terms):
        for name in names:
            p[start::9, reference.NAMES.index(name)] = 0
    p[::4, reference.NAMES.index("presliding_travel")] = 2e-3
    return p


def shared_by(value, m, i):
    """What row i of m is given."""
    return value[i : i + 1] if isinstance(value, np.ndarray) and value.shape[0] == m else value


@pytest.mark.parametrize("m", [0, 1, 2, 7, 20, 33, 60])
def test_batch_has_the_bits_of_single_runs(m, rng):
    p, s = some_rows(rng, m), settings(rng, m, 301)
    batch = _core.simulate_geared(p, **s)
    assert [out.shape for out in batch] == [(m, 301)] * 7
    for i in range(m):
        one = {name: shared_by(value, m, i) for name, value in s.items()}
        for alone, many in zip(_core.simulate_geared(p[i : i + 1], **one), batch, strict=True):
            np.testing.assert_array_equal(alone[0], many[i])


def test_threads_change_nothing(rng):
    p, s = some_rows(rng, 150), settings(rng, 150, 200)
    for threads in (2, 5):
        pairs = zip(_core.simulate_geared(p, **s), _core.simulate_geared(p, threads=threads, **s), strict=True)
        assert all(np.array_equal(one, other) for one, other in pairs)


PROGRAM = """
import sys
import numpy as np
sys.path.insert(0, {folder!r})
import test_core_geared as here
from pellucid import _core
rng = np.random.default_rng(1)
out = _core.simulate_geared(here.some_rows(rng, 61), **here.settings(rng, 61, 200))
import hashlib
print(_core.instructions, hashlib.sha256(b"".join(x.tobytes() for x in out)).hexdigest())
"""


def test_instruction_sets_give_the_same_bits():
    seen = {}
    for wanted in ("baseline", "avx2", "avx512"):
        environment = os.environ | {"PELLUCID_INSTRUCTIONS": wanted}
        program = PROGRAM.format(folder=os.path.dirname(__file__))
        answer = subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
        )
        instructions, digest = answer.stdout.split()
        seen[instructions] = digest
    assert "baseline" in seen
    assert len(set(seen.values())) == 1, seen


def energy(p, out):
    """Of both bodies, the spring and gravity."""
    p = dict(zip(reference.NAMES, p, strict=True))
    twist = out["motor_position"] - out["link_position"]
    stretch = twist - np.clip(twist, -0.5 * p["backlash"], 0.5 * p["backlash"])
    kinetic = p["motor_inertia"] * out["motor_velocity"] ** 2 + p["link_inertia"] * out["link_velocity"] ** 2
    q = out["link_position"]
    return (
        0.5 * (kinetic + p["stiffness"] * stretch**2) - p["gravity_sine"] * np.cos(q) + p["gravity_cosine"] * np.sin(q)
    )


def test_energy_only_falls(rng):
    """No drive: friction, damping and impacts in the gap take energy and never give any."""
    for _ in range(20):
        p = reference.random_parameters(rng)
        start = dict(position0=rng.uniform(-2, 2), velocity0=rng.uniform(-3, 3))
        out = run(p, reference=np.zeros(2000), period=1e-3, substeps=200, **start)
        e = energy(p, out)
        assert np.max(np.diff(e)) < 2e-5 * np.ptp(e)
        assert e[-1] < e[0]


def test_nothing_lost_nothing_gained():
    """Without friction and damping, but with a gap, the energy stays: contact is elastic."""
    p = reference.rigid(link_inertia=0.15, gravity_sine=4.0, motor_inertia=0.08, stiffness=600.0, backlash=0.02)
    out = run(p, reference=np.zeros(5000), period=1e-3, substeps=200, position0=1.0)
    e = energy(p, out)
    assert np.count_nonzero(np.diff(np.sign(out["transmission_torque"]))) > 20
    assert np.ptp(e) < 2e-3


def test_transmission_never_pulls(rng):
    for _ in range(10):
        p = reference.random_parameters(rng, damping=3.0)
        out = run(p, reference=6 * np.sign(np.sin(20e-3 * np.arange(3000))), period=1e-3)
        half = 0.5 * p[reference.NAMES.index("backlash")]
        twist, torque = out["motor_position"] - out["link_position"], out["transmission_torque"]
        assert (torque[np.abs(twist) <= half] == 0).all()
        assert (torque * twist >= 0).all()
        assert np.count_nonzero(torque == 0) > 3


def held_commands(p, torque, q_m):
    """The lowest and highest command that leave the motor where it is."""
    p = dict(zip(reference.NAMES, p, strict=True))
    return torque - reference.dry(p, q_m, 0.0, torque, False), torque + reference.dry(p, q_m, 0.0, torque, True)


@pytest.mark.parametrize("direction", [1, -1])
def test_stiction_does_not_creep(direction, rng):
    """A motor and a link at rest stay there to the bit while the command wanders below breakaway; beyond, it moves."""
    for _ in range(20):
        p = reference.random_parameters(rng, bearing_coulomb=0.2, coulomb_positive=0.5, coulomb_negative=0.4)
        q0 = rng.uniform(-2, 2)
        start = run(p, reference=[0.0], period=1e-3, position0=q0)
        q_m, torque = start["motor_position"][0], start["transmission_torque"][0]
        low, high = held_commands(p, torque, q_m)
        wander = low + (high - low) * rng.uniform(0.001, 0.999, 5000)
        out = run(p, reference=wander, period=1e-3, position0=q0, disturbance=0.19 * rng.uniform(-1, 1, 5000))
        assert (out["motor_position"] == q_m).all()
        assert (out["link_position"] == q0).all()
        assert not out["motor_velocity"].any()
        assert not out["link_velocity"].any()
        edge = high if direction > 0 else low
        out = run(p, reference=np.full(5, edge + direction * 1e-3), period=1e-3, position0=q0)
        assert (out["motor_position"][-1] - q_m) * direction > 0


def test_link_sticks_while_the_motor_turns_in_the_gap():
    p = reference.parameters(backlash=0.2, gravity_sine=0.0, gravity_cosine=0.0)
    out = run(p, reference=np.full(400, 1.5), period=1e-3)
    inside = out["motor_position"] < 0.1
    assert 10 < np.count_nonzero(inside) < 400
    assert not out["link_position"][inside].any()
    assert out["link_position"][-1] > 0.01


def test_a_load_can_lock_the_gear():
    """Generating coefficients that rise above 1 at rest: no weight drives such a gear back."""
    changes = dict(gravity_sine=0.0, coulomb_positive=0.0, coulomb_negative=0.0, stribeck=0.0, load_generating=0.9)
    for rise, locked in ((0.0, False), (0.5, True)):
        p = reference.parameters(gravity_cosine=5.0, load_rise=rise, **changes)
        out = run(p, reference=np.zeros(2000), period=1e-3)
        assert bool(np.all(out["motor_velocity"] == 0)) is locked


def test_stiff_and_tight_is_the_rigid_plant():
    """Without a gap and ever stiffer it moves as one body: the difference falls with the stiffness."""
    t = 1e-3 * np.arange(2000)
    settings = dict(reference=0.5 * np.sin(3 * t), period=1e-3, substeps=100, loop="pd", kp=20.0, kd=1.0)
    one = np.zeros(len(_core.PARAMETER_NAMES))
    one[[0, 1, 2, 6, 7]] = 0.2, 4.0, 1.0, 0.3, 0.3
    wanted = _core.simulate(one, position0=0.2, **settings)[0]
    errors = []
    for stiffness in (1e4, 4e4, 16e4):
        p = reference.rigid(
            link_inertia=0.15, motor_inertia=0.05, gravity_sine=4.0, gravity_cosine=1.0, stiffness=stiffness,
            damping=10.0, viscous_positive=0.3, viscous_negative=0.3,
        )  # fmt: skip
        out = run(p, position0=0.2, **settings)
        errors.append(np.max(np.abs(out["motor_position"] - wanted)))
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 2.5
    assert errors[2] < errors[1] / 2.5


def test_two_bodies_ring_at_their_own_frequency():
    """In contact (gravity preloads it) motor and link swing against each other at sqrt(K (1/J_m + 1/J))."""
    p = reference.rigid(link_inertia=0.15, motor_inertia=0.08, stiffness=600.0, gravity_cosine=20.0)
    push = np.zeros(700)
    push[:5] = 3.0
    out = run(p, reference=np.full(700, 20.0), disturbance=push, period=1e-3, substeps=50)
    stretch = out["transmission_torque"] - 20.0
    up = np.flatnonzero((stretch[:-1] < 0) & (stretch[1:] >= 0))
    at = up - stretch[up] / (stretch[up + 1] - stretch[up])
    period = 1e-3 * (at[-1] - at[0]) / (len(at) - 1)
    assert (out["transmission_torque"] > 0).all()
    assert 2 * np.pi / period == pytest.approx(np.sqrt(600 * (1 / 0.15 + 1 / 0.08)), rel=5e-3)


def test_divergence_is_not_finite_and_ends():
    out = run(reference.parameters(), reference=np.ones(20_000), period=1e-2, substeps=1, loop="pd", kp=1e4, kd=1e3)
    assert not np.isfinite(out["motor_position"][-1])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_bad_numbers_end_and_stay_in_their_row(value):
    good = run(reference.parameters(), reference=np.ones(20), period=1e-3)
    for i in range(23):
        p = np.tile(reference.parameters(), (3, 1))
        p[1, i] = value
        rows = _core.simulate_geared(p, reference=np.ones(20), period=1e-3)
        for name, out in zip(OUTPUTS, rows, strict=True):
            np.testing.assert_array_equal(out[0], good[name])
            np.testing.assert_array_equal(out[2], good[name])


@pytest.mark.parametrize("name", ["link_inertia", "stiffness", "damping", "coulomb_positive", "friction_swing"])
def test_nan_is_seen_in_the_results(name):
    out = run(reference.parameters(**{name: np.nan}), reference=np.full(50, 5.0), period=1e-3, disturbance=np.ones(50))
    assert np.isnan(out["link_position"][-1])


P = reference.parameters()[None]
RUN = dict(reference=np.zeros(5), period=1e-3)


@pytest.mark.parametrize(
    ("error", "changes", "message"),
    [
        (ValueError, dict(parameters=P[0]), "parameters: got shape (23,), expected (m, 23)"),
        (ValueError, dict(parameters=P[:, :13]), "parameters: got shape (1, 13), expected (m, 23)"),
        (ValueError, dict(disturbance=np.zeros((2, 5))), "disturbance: got shape (2, 5), expected (1, 5)"),
        (ValueError, dict(integral0=[1.0, 2.0]), "integral0: got shape (2,), expected a number or (1,)"),
        (TypeError, dict(stiction=True), "simulate_geared() does not know the keyword 'stiction'"),
    ],
)
def test_misuse(error, changes, message):
    arguments = dict(parameters=P) | RUN | changes
    with pytest.raises(error, match=re.escape(message)):
        _core.simulate_geared(arguments.pop("parameters"), **arguments)
