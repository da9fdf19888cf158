"""People who reach by optimal feedback: their gains against SciPy's Riccati equations, and an arm that they move."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from pellucid import _core

LOAD = np.zeros(5)


def person(**changed):
    """Parameters of the core, SI."""
    values = {
        "inertia": 0.0625, "gravity": 3.2, "centre": 0.0, "viscous": 0.1, "passive_torque": 2.0,
        "passive_angle": 0.0, "passive_scale": 0.1, "resting_stiffness": 1.1, "stiffness_per_torque": 3.0,
        "damping_ratio": 0.35, "muscle_delay": 0.02, "activation_time": 0.04, "flexion_max": 54.0,
        "extension_max": 41.0, "cocontraction": 0.012, "uncertainty": 0.15, "uncertainty_time": 0.5,
        "uncertainty_share": 0.25, "noise_share": 0.006, "phasic_noise_share": 0.16, "noise_time": 0.05,
        "feedback_delay": 0.06, "position_noise": 0.008, "velocity_noise": 0.08, "velocity_weight": 1.4,
        "correction_time": 0.4, "tolerance": 0.02, "sign_width": 0.05, "period": 0.001, **changed,
    }  # fmt: skip
    return np.array([values[name] for name in _core.OPTIMAL_PARAMETER_NAMES])


def policy(**changed):
    return _core.optimal_policy(person(**changed), LOAD, amplitude=0.6, target=1.6, duration=0.9, variance=0.0225)


def test_gains_are_scipys_where_noise_is_additive():
    found = policy(phasic_noise_share=0.0)
    t, h, inertia = found["unit_time"], 0.001, 0.0625
    # In SI, with the torque held for a period: position, velocity, torque, torque rate; the control is its roughness.
    a = np.eye(4)
    a[0, 1], a[0, 2], a[1, 2], a[2, 3] = h, h**2 / 2 / inertia, h / inertia, h
    b = np.array([[0.0], [0.0], [h**2 / 2], [h]])
    x = solve_discrete_are(a, b, h * np.diag([1.0, 1.4 * t**2, 0.0, 0.0]), h * np.array([[t**8 / inertia**2]]))
    gain = np.linalg.solve(h * t**8 / inertia**2 + b.T @ x @ b, b.T @ x @ a)[0]
    np.testing.assert_allclose(found["moving"], gain, rtol=1e-5)
    # Noise of what accelerates makes torque dearer: less of it for the same error.
    noisy = policy(phasic_noise_share=0.5)["moving"]
    assert noisy[2] > 1.02 * gain[2]


def test_belief_is_kalmans():
    found = policy()
    k, d, inertia, h = found["stiffness"], found["damping"], 0.0625, 0.001
    f = expm(h * np.array([[0, 1, 0], [-k / inertia, -d / inertia, 1 / inertia], [0, 0, 0]]))
    np.testing.assert_allclose(found["transition"], f, rtol=0, atol=1e-11)
    held = 3.2 * np.sin(1.6) - 2.0 * np.exp(-1.6 / 0.1)
    muscles = np.array([held + 54.0 * found["cocontraction"], 41.0 * found["cocontraction"]])
    white = 2 * 0.05 * np.array([0.006, 0.16]) ** 2
    accelerating = 0.107 * 0.6 / found["unit_time"] ** 2
    q = h * np.diag([0.0, white[0] * np.sum(muscles**2) / inertia**2 + white[1] * accelerating**2, 2 * 0.0225 / 0.5])
    r = 2 * 0.05 / h * np.diag([0.008**2, 0.08**2])
    c = np.eye(3)[:2]
    x = solve_discrete_are(f.T, c.T, q, r)
    gain = x @ c.T @ np.linalg.inv(c @ x @ c.T + r)
    np.testing.assert_allclose(found["belief"], gain, rtol=1e-6)
    np.testing.assert_allclose(found["now"], np.linalg.matrix_power(f, 80) @ gain, rtol=1e-6, atol=1e-12)


def arm(**changed):
    strap = np.array([120.0, 1.2] + [0.0] * (len(_core.STRAP_PARAMETER_NAMES) - 2))
    return _core.WornElbow(person(**changed), LOAD, position0=1.0, strap=strap, drive=[1.0, 1.0, 0.0, 0.0, 1e-4],
                           emg_gains=[1.0, 1.0], substeps=4, person="optimal")  # fmt: skip


def moved(duration, seed=None):
    n = 4000
    noise = np.zeros((n, 5)) if seed is None else np.random.default_rng(seed).standard_normal((n, 5))
    return arm().move(target=1.6, amplitude=0.6, duration=duration, reaction=0.2, load=LOAD, tolerance=0.0, hold=1e9,
                      noise=noise, longest=n)  # fmt: skip


@pytest.mark.parametrize("duration", [0.4, 0.9, 1.5])
def test_a_movement_takes_what_one_of_minimum_jerk_would(duration):
    position, velocity = moved(duration)[:2]
    fast = np.flatnonzero(velocity > 0.05 * velocity.max())
    width = 0.001 * (fast[-1] - fast[0])
    assert width == pytest.approx(np.sqrt(1 - np.sqrt(0.05)) * duration, rel=0.04)
    assert 0.35 < 0.001 * (velocity.argmax() - fast[0]) / width < 0.55
    assert abs(position[-1] - 1.6) < 0.01
    assert position.max() < 1.61


def test_the_same_noise_gives_the_same_movement():
    first, second, other = moved(0.7, 1), moved(0.7, 1), moved(0.7, 2)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.abs(first[0] - other[0]).max() > 1e-3


def test_other_numbers_are_refused():
    with pytest.raises(ValueError, match="parameters"):
        _core.optimal_policy(person()[:-1], LOAD, amplitude=0.6, target=1.6, duration=0.9, variance=0.02)
