"""What a joint with a carriage does with energy: one coherent body stores it and rubs it away, two sets make it."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from slider_motions import made_up

from pellucid import _core
from pellucid.joint.slider.slider_fit import fit_coherent, three_steps
from pellucid.joint.slider.study.identify_slider import directional_friction
from pellucid.models.simulate import cycle_energy, net_energy
from pellucid.models.slider_joint import DirectionalSliderModel, SliderJointModel
from pellucid_lab.papers.able.elbow import able_elbow

DRAWS = 60
RANGES = {
    "inertia": (0.001, 0.2),
    "carriage_moment": (-0.02, 0.02),
    "carriage_mass": (0.0, 1.5),
    "gravity": (-4.0, 4.0),
    "gravity_cosine": (-1.0, 1.0),
    "coulomb_positive": (0.0, 0.6),
    "coulomb_negative": (0.0, 0.6),
    "viscous_positive": (0.0, 0.3),
    "viscous_negative": (0.0, 0.3),
    "load_motoring": (0.0, 5.0),
    "load_generating": (0.0, 0.9),
    "load_friction": (0.0, 0.9),
}


def models(rng):
    """Families with and without a known carriage, values anywhere within their bounds, some of them on a bound."""
    for family, known in (("consistent", {}), ("load", {}), ("load", {"carriage_mass": 0.48})):
        model = SliderJointModel(family, known)
        for _ in range(DRAWS // 3):
            values = np.array([rng.uniform(*RANGES[name]) for name in model.names])
            lower, upper = model.bounds()
            ends = (lower == 0.0) & (rng.random(len(values)) < 0.1)
            values[ends] = lower[ends]
            assert np.all((lower <= values) & (values <= upper))
            yield model, values, float(rng.uniform(0.0, 0.4))


def loop(rng, n=4096):
    """A closed cycle of up to six harmonics and an amplitude from 0.001 to 1.5 rad: q, v, a and its period."""
    period, amplitude = float(rng.uniform(0.3, 8.0)), 10.0 ** rng.uniform(-3.0, np.log10(1.5))
    phase, w = 2.0 * np.pi * np.arange(n) / n, 2.0 * np.pi / period
    q, v, a = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(1, int(rng.integers(2, 7))):
        c, s = rng.standard_normal(2) / k
        q += c * np.cos(k * phase) + s * np.sin(k * phase)
        v += k * w * (s * np.cos(k * phase) - c * np.sin(k * phase))
        a -= (k * w) ** 2 * (c * np.cos(k * phase) + s * np.sin(k * phase))
    scale = amplitude / np.abs(q).max()
    return rng.uniform(-np.pi, np.pi) + scale * q, scale * v, scale * a, period


def test_gravity_and_inertia_take_no_energy_over_a_closed_cycle(rng):
    for model, values, x in models(rng):
        q, v, a, period = loop(rng)
        body = _core.load(model.vector(values, x), q, a)
        power = body * v
        moved = net_energy(np.abs(power), np.ones(len(v)), period)
        assert moved > 0.0
        assert abs(net_energy(body, v, period)) <= 1e-9 * moved, (model.family, values, x)


@pytest.mark.parametrize("width", [0.0, 1e-6, 0.01, 0.5])
def test_friction_opposes_motion_at_every_point(rng, width):
    for model, values, x in models(rng):
        vector = model.vector(values, x, width)
        size = 10.0 ** rng.uniform(-12.0, 1.0, (3, 300)) * rng.choice([-1.0, 0.0, 1.0], (3, 300))
        q, v, a = np.hstack([size, np.zeros((3, 2)), [[0.3], [1e-12], [0.0]], [[0.3], [-1e-12], [0.0]]])
        f = _core.inverse_dynamics(vector, q, v, a) - _core.load(vector, q, a)
        # The difference of two torques rounds off; the friction alone must not.
        alone = np.asarray(_core.friction(vector, v, _core.load(vector, q, a)))
        assert np.all(alone * v >= 0.0), (model.family, values)
        assert np.all(alone[v == 0.0] == 0.0)
        assert f == pytest.approx(alone, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8, 1.0])
def test_compensating_a_share_of_the_friction_never_drives_the_joint_it_describes(rng, share):
    for model, values, x in models(rng):
        q, v, a, period = loop(rng)
        own, smooth = model.vector(values, x), model.vector(values, x, float(10.0 ** rng.uniform(-4.0, 0.0)))
        y = np.asarray(_core.load(own, q, a))
        takes = np.asarray(_core.friction(own, v, y)) * v
        given = share * np.asarray(_core.friction(smooth, v, y)) * v
        slack = 1e-12 * np.abs(takes).max()
        assert np.all(given <= takes + slack), (model.family, values)
        compensation = y + share * np.asarray(_core.friction(smooth, v, y))
        joint = np.asarray(_core.inverse_dynamics(own, q, v, a))
        moved = net_energy(np.abs(joint * v), np.ones(len(v)), period)
        assert net_energy(compensation - joint, v, period) <= 1e-12 * moved


def test_overcompensating_drives_it(rng):
    """The law above can fail: a fifth more than the friction puts energy in wherever there is friction."""
    model = SliderJointModel("load", {"carriage_mass": 0.48})
    values = np.array([0.03, -0.004, 1.1, 0.2, 0.2, 0.15, 0.05, 0.04, 0.13, 0.11])
    vector = model.vector(values, 0.2)

    def excess(q, v, a):
        return 0.2 * np.asarray(_core.friction(vector, v, _core.load(vector, q, a)))

    assert cycle_energy(excess, 0.3, 0.8, 0.5) > 0.0


def table2():
    """Table II as published, in this package's angle: sin q_4 there is -cos q here. Positive is up."""
    sets = []
    for name in ("up", "down"):
        s = able_elbow().direction(name)
        sets.append(np.array([s.m_x_slope, s.m_x_offset, -s.m_y, s.coulomb, s.viscous, *s.inertia]))
    return DirectionalSliderModel(*sets)


def test_table_2_is_converted_as_printed():
    paper, model = able_elbow(), table2()
    q = np.linspace(0.3, 2.0, 9)
    for name, sign in (("up", 1.0), ("down", -1.0)):
        printed = paper.torque(name, 0.1, q - 0.5 * np.pi, np.full(9, sign), np.full(9, 0.7))
        assert model.torque(q, np.full(9, sign), np.full(9, 0.7), 0.1) == pytest.approx(printed, rel=1e-12)


AMPLITUDES = (1e-3, 3e-3, 1e-2, 3e-2, 0.1)
SPEED = 0.3  # rad/s at the middle of a cycle


def energies(torque_of, centre):
    """Energy per cycle at each of `AMPLITUDES`, all as fast in their middle."""
    return np.array([cycle_energy(torque_of, b, centre, SPEED / (2.0 * np.pi * b)) for b in AMPLITUDES])


def extremes(model, sliders):
    """(x, q) where the sets imply the least and the most friction at rest, and these two."""
    q = np.linspace(-0.5, 2.6, 125)
    f = directional_friction(model, sliders, q)
    low, high = (np.unravel_index(k, f.shape) for k in (f.argmin(), f.argmax()))
    return (sliders[low[0]], q[low[1]], f[low]), (sliders[high[0]], q[high[1]], f[high])


def test_a_joint_of_table_2_would_be_a_source_of_energy():
    """Where the implied friction is negative, moving such a joint to and fro yields work, however small the motion."""
    model = table2()
    (x, q, f), _ = extremes(model, np.linspace(0.0, 0.15, 16))
    assert f < -0.1
    work = energies(lambda *motion: model.torque(*motion, x), q)
    assert np.all(work < 0.0)
    assert np.all(np.diff(work) < 0.0)
    # At a vanishing amplitude b the cycle takes 4 b f, and viscous friction.
    viscous = np.pi * SPEED * np.array(AMPLITUDES) * 0.5 * (model.up[4] + model.down[4])
    assert work[0] == pytest.approx(4.0 * AMPLITUDES[0] * f + viscous[0], rel=0.05)


def test_compensating_with_table_2_drives_a_joint_with_the_friction_that_it_prints():
    """Where gravity upward exceeds gravity downward, the compensation gives more than its own friction terms take."""
    model = table2()
    _, (x, q, f) = extremes(model, np.linspace(0.0, 0.15, 16))
    rubs = DirectionalSliderModel(*(np.concatenate([np.zeros(3), s[3:5], np.zeros(3)]) for s in (model.up, model.down)))
    assert f > 0.5 * (model.up[3] + model.down[3])
    given = energies(lambda *motion: model.torque(*motion, x) - rubs.torque(*motion, x), q)
    assert np.all(given > 0.0)
    assert np.all(np.diff(given) > 0.0)


def test_two_sets_fitted_to_friction_by_load_make_energy_where_the_load_changes_sign():
    """Fitted where gravity loads one way, two sets take friction by load for gravity; past the vertical they give work.

    One coherent body with the same frictions, from the same data, does not.
    """
    truth = SliderJointModel("load", {"carriage_mass": 0.48})
    values = np.array([0.031, -0.004, 1.15, 0.26, 0.1, 0.08, 0.05, 0.04, 0.14, 0.11])
    motions = made_up(lambda m: truth.effort(values, m))
    model = three_steps(motions, dissociated=True, method="dissociated").model
    x, q = 0.25, -1.2
    assert directional_friction(model, np.array([x]), np.array([q]))[0, 0] < 0.0
    work = energies(lambda *motion: model.torque(*motion, x), q)
    assert np.all(work < 0.0)
    assert np.all(np.diff(work) < 0.0)
    found = fit_coherent(truth, motions, rail=(0.1, 0.3)).values

    def coherent(q, v, a):
        return np.asarray(_core.inverse_dynamics(truth.vector(found, x), q, v, a))

    assert np.all(energies(coherent, q) > 0.0)
    # In turn these sets overcompensate a joint whose load has no gravity to pass on, as one that carries its balance.
    q = 1.4
    bare = truth.vector(np.array([0.031, -0.004, 0.0, 0.0, 0.1, 0.08, 0.05, 0.04, 0.0, 0.0]), 0.0)

    def excess(q, v, a):
        return model.torque(q, v, a, x) - np.asarray(_core.inverse_dynamics(bare, q, v, a))

    given = energies(excess, q)
    assert np.all(given > 0.0)
    assert np.all(np.diff(given) > 0.0)
