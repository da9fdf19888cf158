"""The plant against a plain Python loop, sample by sample; stiction; what may not happen."""

import numpy as np
import numpy_reference as reference
import pytest

from pellucid import _core

LOOPS = {
    "open": dict(loop="none", gain=2.0, back_emf=0.05),
    "p": dict(loop="p", kp=20.0),
    "p limited": dict(loop="p", kp=20.0, limit=1.0),
    "pi": dict(loop="pi", kp=15.0, ki=20.0, limit=2.5),
    "pd": dict(loop="pd", kp=15.0, kd=0.5, velocity_span=0),
    "pd over a span": dict(loop="pd", kp=15.0, kd=0.3, velocity_span=3, limit=4.0),
    "cascade": dict(loop="cascade", kp=12.0, kv=1.2, velocity_span=1, limit=3.0),
    "cascade with integral": dict(loop="cascade", kp=12.0, kv=1.2, ki=3.0, velocity_span=8, limit=2.5),
    "velocity": dict(loop="velocity_pi", kp=1.0, ki=5.0, velocity_span=2, limit=3.0),
}


def signals(n, period, rng):
    t = period * np.arange(n)
    return dict(
        reference=0.8 * np.sin(4 * t) + 0.2 * np.sin(23 * t),
        injected=0.3 * np.sign(np.sin(31 * t)),
        disturbance=0.2 * np.sin(2 * t),
        encoder_noise=1e-5 * rng.standard_normal(n),
    )


@pytest.mark.parametrize("stiction", [False, True])
@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS)
def test_plant_is_that_of_python(loop, stiction, rng):
    settings = dict(
        period=1e-3, substeps=5, encoder_quantum=2e-4, ripple_amplitude=0.05, ripple_wave_number=14.0, ripple_phase=0.4,
        position0=0.1, velocity0=-0.2, stiction=stiction, **loop, **signals(800, 1e-3, rng),
    )  # fmt: skip
    got = _core.simulate(reference.parameters(), **settings)
    wanted = reference.simulate(reference.parameters(), **settings)
    for one, other in zip(got, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"velocity_width": 0.0},
        {"stribeck_velocity": 0.0},
        {"load_motoring": 0.0, "load_generating": 0.0},
        {"gravity_sine": 0.0, "gravity_cosine": 0.0},
    ],
)
def test_terms_that_are_left_out_are_zero(changes, rng):
    p = reference.parameters(inertia=0.2, **changes)
    settings = dict(period=1e-3, substeps=4, loop="p", kp=20.0, **signals(500, 1e-3, rng))
    for one, other in zip(_core.simulate(p, **settings), reference.simulate(p, **settings), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


def test_values_are_those_at_the_sample_instants():
    p = reference.parameters()
    q, v, a, u, effort, measured = _core.simulate(
        p,
        reference=[1.0, 2.0],
        period=1e-3,
        substeps=1,
        gain=3.0,
        back_emf=0.5,
        injected=[0.5, 0.0],
        position0=0.2,
        velocity0=0.1,
    )
    assert (q[0], v[0], measured[0]) == (0.2, 0.1, 0.2)
    assert u.tolist() == [1.5, 2.0]
    assert effort[0] == 3.0 * 1.5 - 0.5 * 0.1
    assert a[0] == _core.forward_dynamics(p, q[:1], v[:1], effort[:1])[0]
    assert v[1] == v[0] + 1e-3 * a[0]
    assert q[1] == q[0] + 1e-3 * v[1]


def test_current_does_not_show_ripple_and_disturbance(rng):
    settings = dict(period=1e-3, reference=np.ones(50), gain=2.0)
    effort = _core.simulate(
        reference.parameters(),
        ripple_amplitude=0.3,
        ripple_wave_number=9.0,
        disturbance=rng.normal(size=50),
        **settings,
    )[4]
    np.testing.assert_array_equal(effort, 2.0)


def breakaway_command(p, q, direction):
    """The largest command that moves nothing: |net| = level at rest + alpha |gravity|."""
    p = dict(zip(reference.NAMES, p, strict=True))
    gravity = p["gravity_sine"] * np.sin(q) + p["gravity_cosine"] * np.cos(q) + p["parallel_stiffness"] * q
    level = p["stribeck"] + (p["coulomb_positive"] if direction > 0 else p["coulomb_negative"])
    alpha = p["load_motoring"] if gravity * direction > 0 else p["load_generating"]
    return p["offset"] + gravity + direction * (level + alpha * abs(gravity))


@pytest.mark.parametrize("direction", [1, -1])
def test_stiction_does_not_creep(direction, rng):
    for _ in range(20):
        p = reference.random_parameters(rng)
        q0 = rng.uniform(-2, 2)
        edge, other = breakaway_command(p, q0, direction), breakaway_command(p, q0, -direction)
        held = other + (edge - other) * rng.uniform(0.001, 0.999, 5000)
        q, v, a, *_ = _core.simulate(p, reference=held, period=1e-3, position0=q0, stiction=True)
        assert (q == q0).all()
        assert not v.any()
        assert not a.any()
        moving = np.full(200, edge + direction * 1e-3)
        q, *_ = _core.simulate(p, reference=moving, period=1e-3, position0=q0, stiction=True)
        assert (q[-1] - q0) * direction > 0


def test_smooth_friction_does_creep():
    """Why stiction is a mode of its own."""
    q, *_ = _core.simulate(
        reference.parameters(gravity_sine=0.0, gravity_cosine=0.0), reference=np.full(2000, 0.2), period=1e-3
    )
    assert q[-1] > 0.01


def test_stick_and_slip():
    """A mass pulled slowly through a spring (a soft P loop) sticks and slips; with smooth friction it slides."""
    p = reference.parameters(
        gravity_sine=0.0,
        gravity_cosine=0.0,
        offset=0.0,
        stribeck=0.4,
        inertia=0.01,
        viscous_positive=0.0,
        velocity_width=0.2,
    )
    settings = dict(reference=0.2 * np.arange(20_000) * 1e-3, period=1e-3, loop="p", kp=5.0)
    v = _core.simulate(p, stiction=True, **settings)[1]
    assert 0.1 < np.mean(v == 0) < 0.95
    assert np.count_nonzero(np.diff((v == 0).astype(int)) == 1) > 3
    assert not (_core.simulate(p, **settings)[1][100:] == 0).any()


def test_divergence_is_not_finite_and_ends():
    q, *_ = _core.simulate(
        reference.parameters(), reference=np.ones(20_000), period=1e-2, substeps=1, loop="pd", kp=1e4, kd=1e3
    )
    assert not np.isfinite(q[-1])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_bad_parameters_end(value):
    for i in range(len(reference.NAMES)):
        p = reference.parameters()
        p[i] = value
        for stiction in (False, True):
            assert _core.simulate(p, reference=np.ones(20), period=1e-3, stiction=stiction)[0].shape == (20,)


def test_frictionless_limit_keeps_energy():
    p = np.zeros(len(reference.NAMES))
    p[:2] = 0.05, 1.5
    q, v, *_ = _core.simulate(p, reference=np.zeros(20_000), period=1e-3, substeps=20, position0=1.0)
    energy = 0.5 * 0.05 * v**2 - 1.5 * np.cos(q)
    assert np.ptp(energy) < 5e-4
