"""Exact derivatives against central differences: joints, and trajectories that saturate, stick and slip."""

import numpy as np
import numpy_reference as reference
import pytest

from pellucid import _core

EVERY = np.arange(len(reference.NAMES))


def central_differences(f, p, active, steps):
    """Richardson's extrapolation of two central differences: error h^4."""
    columns = []
    for i in active:
        slopes = []
        for h in (steps[i], steps[i] / 2):
            up, down = p.copy(), p.copy()
            up[i] += h
            down[i] -= h
            slopes.append((f(up) - f(down)) / (2 * h))
        columns.append((4 * slopes[1] - slopes[0]) / 3)
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("scale", [0.0, 1e-8, 1.0], ids=["zero", "small", "random"])
def test_inverse_dynamics_jacobian(scale, rng):
    for _ in range(20):
        p = reference.random_parameters(rng)
        q, v, a = (scale * rng.uniform(-3, 3, 50) for _ in range(3))
        effort, jacobian = _core.inverse_dynamics_jacobian(p, q, v, a, EVERY)
        np.testing.assert_array_equal(effort, _core.inverse_dynamics(p, q, v, a))
        # Away from the corners of |y|: the load must keep its sign while parameters are stepped.
        smooth = np.abs(_core.load(p, q, a)) > (0 if scale == 0 else 1e-2)
        differences = central_differences(
            lambda x, at=(q, v, a): _core.inverse_dynamics(x, *at), p, EVERY, 1e-4 * np.maximum(np.abs(p), 0.01)
        )
        np.testing.assert_allclose(jacobian[smooth], differences[smooth], rtol=1e-6, atol=1e-7)


def test_order_and_number_of_active_parameters(rng):
    p = reference.parameters()
    q, v, a = rng.uniform(-3, 3, (3, 30))
    _, whole = _core.inverse_dynamics_jacobian(p, q, v, a, EVERY)
    for active in ([], [4], [12, 0, 7], [3, 3], list(range(8)), list(range(12, -1, -1)), [0] * 40):
        effort, part = _core.inverse_dynamics_jacobian(p, q, v, a, active)
        assert part.shape == (30, len(active))
        np.testing.assert_array_equal(part, whole[:, np.array(active, int)])
        np.testing.assert_array_equal(effort, _core.inverse_dynamics(p, q, v, a))


def test_no_stribeck_velocity_no_derivative():
    p = reference.parameters(stribeck_velocity=0.0)
    _, jacobian = _core.inverse_dynamics_jacobian(p, [0.0, 0.1], [0.0, 0.2], [0.0, 0.3], EVERY)
    assert np.isfinite(jacobian).all()
    assert (jacobian[:, [8, 9]] == 0).all()


TRAJECTORIES = {
    "open loop": dict(loop="none", amplitude=3.0),
    "cascade": dict(loop="cascade", kp=10.0, kv=1.0, ki=2.0),
    "saturated": dict(loop="cascade", kp=30.0, kv=2.0, ki=5.0, limit=1.8),
    "saturated over a span": dict(loop="pd", kp=30.0, kd=0.5, velocity_span=3, limit=1.2),
    "velocity": dict(loop="velocity_pi", kp=1.0, ki=5.0, limit=1.0, velocity_span=2, amplitude=5.0),
}


@pytest.mark.parametrize("settings", TRAJECTORIES.values(), ids=TRAJECTORIES)
@pytest.mark.parametrize("width", [0.02, 0.1], ids=["nearly stick-slip", "smooth"])
def test_trajectory_jacobian(settings, width, rng):
    p = reference.parameters(velocity_width=width)
    t = 1e-3 * np.arange(1500)
    settings = settings.copy()
    settings |= dict(
        reference=settings.pop("amplitude", 1.2) * np.sin(5 * t), period=1e-3, substeps=4,
        disturbance=0.1 * np.sin(3 * t), gain=1.3, back_emf=0.05,
        ripple_amplitude=0.02, ripple_wave_number=7.0, position0=0.05, velocity0=0.3,
    )  # fmt: skip
    result = _core.simulate_jacobian(p, active=EVERY, **settings)
    plain = _core.simulate(p, **settings)
    for one, other in zip(result, plain, strict=False):
        np.testing.assert_array_equal(one, other)
    if settings.get("limit"):
        assert 0.1 < np.mean(np.abs(plain[3]) == settings["limit"]) < 0.99, "the trajectory saturates, and not always"
    assert np.count_nonzero(np.diff(np.sign(plain[1]))) > 0, "the velocity changes sign"
    for which, jacobian in zip((0, 1, 2, 4), result[6:], strict=True):
        differences = central_differences(
            lambda x, i=which: _core.simulate(x, **settings)[i], p, EVERY, 1e-5 * np.maximum(np.abs(p), 0.01)
        )
        # Corners (saturation, |y|) that lie between two steps make the differences wrong for some samples after them.
        error = np.abs(jacobian - differences) / (np.abs(differences).max(axis=0) + 1e-9)
        assert np.quantile(error, 0.95, axis=0).max() < 1e-3
        assert np.quantile(error, 0.5, axis=0).max() < 1e-5


def test_trajectory_jacobian_without_corners():
    """Nothing that switches: every sample of every derivative agrees."""
    p = reference.parameters(
        coulomb_negative=0.3, viscous_negative=0.1, load_motoring=0.0, load_generating=0.0, velocity_width=0.1
    )
    active = np.array([0, 1, 2, 3, 8, 9, 12])
    t = 1e-3 * np.arange(1500)
    settings = dict(reference=1.2 * np.sin(5 * t), period=1e-3, loop="cascade", kp=10.0, kv=1.0, ki=2.0)
    result = _core.simulate_jacobian(p, active=active, **settings)
    for which, jacobian in zip((0, 1, 2, 4), result[6:], strict=True):
        differences = central_differences(
            lambda x, i=which: _core.simulate(x, **settings)[i], p, active, 1e-3 * np.maximum(np.abs(p), 0.1)
        )
        assert (np.abs(jacobian - differences) / np.abs(differences).max(axis=0)).max() < 1e-7


def test_blocks_of_eight_are_one_jacobian(rng):
    settings = dict(reference=np.sin(1e-2 * np.arange(300)), period=1e-3, loop="p", kp=10.0)
    whole = _core.simulate_jacobian(reference.parameters(), active=EVERY, **settings)
    for i in EVERY:
        one = _core.simulate_jacobian(reference.parameters(), active=[i], **settings)
        for a, b in zip(one[6:], whole[6:], strict=True):
            np.testing.assert_array_equal(a[:, 0], b[:, i])


def test_encoder_is_differentiated_as_its_mean_slope():
    """The staircase's own slope is 0 and would open the loop; its mean slope is that of the encoder without steps."""
    settings = dict(reference=np.sin(1e-2 * np.arange(400)), period=1e-3, loop="pd", kp=10.0, kd=0.2)
    fine = _core.simulate_jacobian(reference.parameters(), active=EVERY, encoder_quantum=1e-9, **settings)
    none = _core.simulate_jacobian(reference.parameters(), active=EVERY, **settings)
    np.testing.assert_allclose(fine[6], none[6], rtol=1e-4, atol=1e-6)


def test_stiction_is_refused():
    with pytest.raises(ValueError, match="stiction: not differentiable"):
        _core.simulate_jacobian(reference.parameters(), active=[0], reference=[0.0], period=1e-3, stiction=True)
