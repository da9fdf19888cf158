"""Friction, inverse and forward dynamics against plain NumPy, and their laws."""

import numpy as np
import numpy_reference as reference
import pytest

from pellucid import _core

POINTS = {"zero": 0.0, "small": 1e-8, "random": 1.0}


def points(rng, scale, n=200):
    return scale * rng.uniform(-3, 3, n), scale * rng.uniform(-5, 5, n), scale * rng.uniform(-30, 30, n)


def test_order_of_parameters():
    assert _core.PARAMETER_NAMES == reference.NAMES


@pytest.mark.parametrize("scale", POINTS.values(), ids=POINTS)
@pytest.mark.parametrize(
    "changes", [{}, {"velocity_width": 0.0}, {"stribeck_velocity": 0.0}, {"stribeck_velocity": -1.0}]
)
def test_dynamics_are_those_of_numpy(rng, scale, changes):
    for _ in range(20):
        p = reference.random_parameters(rng, **changes)
        q, v, a = points(rng, scale)
        y = reference.load(p, q, a)
        np.testing.assert_allclose(_core.load(p, q, a), y, rtol=1e-14, atol=1e-14)
        np.testing.assert_allclose(_core.friction(p, v, y), reference.friction(p, v, y), rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(
            _core.inverse_dynamics(p, q, v, a), reference.inverse_dynamics(p, q, v, a), rtol=1e-13, atol=1e-13
        )


@pytest.mark.parametrize("scale", POINTS.values(), ids=POINTS)
def test_forward_dynamics_solves_inverse_dynamics(rng, scale):
    for width in (0.0, 0.05):
        p = reference.random_parameters(rng, velocity_width=width)
        q, v, effort = points(rng, scale, 40)
        np.testing.assert_allclose(
            _core.forward_dynamics(p, q, v, effort), reference.forward_dynamics(p, q, v, effort), rtol=1e-10, atol=1e-8
        )


@pytest.mark.parametrize("scale", POINTS.values(), ids=POINTS)
def test_round_trip_is_the_identity(rng, scale):
    for _ in range(50):
        p = reference.random_parameters(rng, velocity_width=rng.choice([0.0, 0.05]))
        q, v, effort = points(rng, scale)
        back = _core.inverse_dynamics(p, q, v, _core.forward_dynamics(p, q, v, effort))
        np.testing.assert_allclose(back, effort, rtol=1e-13, atol=1e-13)


def test_prismatic_joint_is_the_same_without_gravity(rng):
    p = reference.parameters(gravity_sine=0.0, gravity_cosine=0.0, inertia=100.0, parallel_stiffness=0.0)
    _, v, a = points(rng, 1.0)
    q = rng.uniform(-1e6, 1e6, v.size)
    np.testing.assert_array_equal(_core.inverse_dynamics(p, q, v, a), _core.inverse_dynamics(p, 0 * q, v, a))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308, 5e-324])
def test_every_input_gives_an_output(value):
    x = np.array([value, 0.0, 1.0])
    for i in range(len(reference.NAMES)):
        p = reference.parameters()
        p[i] = value
        assert _core.forward_dynamics(p, x, x, x).shape == _core.inverse_dynamics(p, x, x, x).shape == (3,)


def test_number_of_samples_does_not_matter(rng):
    p = reference.parameters()
    q, v, a = points(rng, 1.0, 100)
    whole = _core.inverse_dynamics(p, q, v, a)
    for n in range(40):
        np.testing.assert_array_equal(_core.inverse_dynamics(p, q[:n], v[:n], a[:n]), whole[:n])


def test_root_of_speed_is_what_a_line_cannot_be():
    """F_r sqrt|v| sign v, the same both ways; smooth through 0 where the sign is smooth; none where F_r is 0."""
    speeds = np.array([-4.0, -0.01, 0.0, 0.01, 4.0])
    none = dict.fromkeys(reference.NAMES, 0.0)
    sharp = reference.parameters(**none | {"square_root": 0.5})
    got = _core.friction(sharp, speeds, np.zeros(5))
    np.testing.assert_allclose(got, [-1.0, -0.05, 0.0, 0.05, 1.0], rtol=1e-15)
    smooth = reference.parameters(**none | {"square_root": 0.5, "velocity_width": 0.04})
    near = _core.friction(smooth, 1e-6 * speeds, np.zeros(5))
    np.testing.assert_allclose(near, 0.5 * 1e-6 * speeds / 0.2, rtol=1e-6)
    far = _core.friction(smooth, 100 * speeds, np.zeros(5))
    np.testing.assert_allclose(far[[0, 4]], [-10.0, 10.0], rtol=1e-6)
    assert np.all(_core.friction(reference.parameters(**none), speeds, np.zeros(5)) == 0.0)
