"""Hill muscles against plain NumPy; their Jacobian against central differences; sample by sample against arrays."""

import os
import subprocess
import sys

import muscle_reference as reference
import numpy as np
import pytest

from pellucid import _core

PERIOD = 2e-3
EVERY = np.arange(33).reshape(3, 11)


@pytest.fixture
def case(rng):
    muscles = reference.random_muscles(rng)
    return muscles, reference.random_motion(rng, muscles, 1700, PERIOD)


def test_the_order_of_parameters():
    assert reference.NAMES == _core.MUSCLE_PARAMETER_NAMES


def test_torque_is_the_equations(rng):
    for _ in range(20):
        muscles = reference.random_muscles(rng)
        motion = reference.random_motion(rng, muscles, 700, PERIOD)
        expected = reference.torque(muscles, *motion, PERIOD)
        got = _core.hill_torque(muscles, *motion, period=PERIOD)
        np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-10 * np.abs(expected).max())


def test_states_are_the_equations(case):
    muscles, (e, length, rate, _) = case
    activation, force, fibre, velocity = _core.hill_states(muscles, e, length, rate, period=PERIOD)
    for i, row in enumerate(muscles):
        a = reference.activation(row, e[i], PERIOD)
        np.testing.assert_allclose(activation[i], a, rtol=1e-12)
        np.testing.assert_allclose(force[i], reference.force(row, a, length[i], rate[i]), rtol=1e-11)
    # A fibre of constant height: its own rate is the musculotendon's along the tendon.
    numeric = np.gradient(fibre, PERIOD, axis=1) / (muscles[:, 8:9] * muscles[:, 4:5])
    np.testing.assert_allclose(velocity[:, 5:-5], numeric[:, 5:-5], atol=2e-5)


def test_jacobian_is_central_differences(case):
    muscles, motion = case
    torque, jacobian = _core.hill_jacobian(muscles, *motion, EVERY, np.ones((3, 11)), period=PERIOD)
    np.testing.assert_array_equal(torque, _core.hill_torque(muscles, *motion, period=PERIOD))

    def at(i, q, h):
        moved = muscles.copy()
        moved[i, q] += h
        return _core.hill_torque(moved, *motion, period=PERIOD)

    for i in range(3):
        for q in range(11):
            h = 1e-4 * max(abs(muscles[i, q]), 0.01)
            slopes = [(at(i, q, s) - at(i, q, -s)) / (2 * s) for s in (h, h / 2)]
            expected = (4 * slopes[1] - slopes[0]) / 3
            error = np.abs(jacobian[11 * i + q] - expected) / np.abs(expected).max()
            assert np.quantile(error, 0.99) < 1e-7, _core.MUSCLE_PARAMETER_NAMES[q]


def test_a_straight_shape_joins_the_curved_ones(case):
    muscles, motion = case
    near = [muscles.copy() for _ in range(3)]
    for one, shape in zip(near, (-1e-2 - 1e-9, -1e-2 + 1e-9, 0.0), strict=True):
        one[:, 0] = shape
    results = [_core.hill_jacobian(m, *motion, EVERY, np.ones((3, 11)), period=PERIOD) for m in near]
    np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-8)
    np.testing.assert_allclose(results[0][1][0], results[1][1][0], rtol=1e-7, atol=1e-9)
    assert np.isfinite(results[2][1]).all()


def test_normal_equations_are_those_of_the_jacobian(case, rng):
    muscles, motion = case
    column = np.full((3, 11), -1)
    column[:, 4], column[:, 3], column[0, 6], column[1:, 6] = 0, 1, 2, 3  # shared, shared, one, two
    gain = rng.uniform(0.5, 2.0, (3, 11))
    measured, weight = rng.standard_normal(1700), rng.uniform(0.0, 2.0, 1700)
    torque, jacobian = _core.hill_jacobian(muscles, *motion, column, gain, period=PERIOD)
    _, every = _core.hill_jacobian(muscles, *motion, EVERY, gain, period=PERIOD)
    np.testing.assert_allclose(jacobian[0], every[4] + every[15] + every[26], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(jacobian[3], every[17] + every[28], rtol=1e-9, atol=1e-9)
    cost, gradient, normal = _core.hill_normal(
        muscles, *motion, column, gain, measured, period=PERIOD, weight=weight
    )  # fmt: skip
    residual, weighed = weight * (torque - measured), weight * jacobian
    assert cost == pytest.approx(0.5 * residual @ residual, rel=1e-12)
    np.testing.assert_allclose(gradient, weighed @ residual, rtol=1e-10)
    np.testing.assert_allclose(normal, weighed @ weighed.T, rtol=1e-11)


def test_sample_by_sample_is_the_same(case):
    muscles, motion = case
    expected = _core.hill_torque(muscles, *motion, period=PERIOD)
    estimator = _core.HillTorque(muscles, period=PERIOD)
    assert [estimator.step(*(x[:, k] for x in motion)) for k in range(60)] == expected[:60].tolist()
    np.testing.assert_array_equal(estimator.run(*(np.ascontiguousarray(x[:, 60:]) for x in motion)), expected[60:])
    estimator.reset()
    np.testing.assert_array_equal(estimator.run(*motion), expected)
    np.testing.assert_allclose(estimator.forces @ motion[3][:, -1], expected[-1], rtol=1e-12)


def test_recordings_do_not_touch_each_other(case):
    muscles, motion = case
    starts = [0, 3, 700]
    whole = _core.hill_torque(muscles, *motion, period=PERIOD, starts=starts)
    for first, last in ((0, 3), (3, 700), (700, 1700)):
        part = [np.ascontiguousarray(x[:, first:last]) for x in motion]
        np.testing.assert_array_equal(whole[first:last], _core.hill_torque(muscles, *part, period=PERIOD))


def test_delays_are_what_a_slow_envelope_shows(rng):
    muscles = reference.random_muscles(rng)
    muscles[:, 0] = 0.0
    t = PERIOD * np.arange(4000)
    ramp = np.tile(0.05 + 0.1 * t, (3, 1))
    still = np.tile(muscles[:, 4:5] + muscles[:, 5:6], (1, 4000))
    activation = _core.hill_states(muscles, ramp, still, 0 * still, period=PERIOD)[0]
    late = (ramp[:, -1] - activation[:, -1]) / 0.1
    np.testing.assert_allclose(_core.HillTorque(muscles, period=PERIOD).delays, late, rtol=1e-9)


def test_the_same_bits_with_every_instruction_set():
    code = (
        "import numpy as np, muscle_reference as r, hashlib\nfrom pellucid import _core\n"
        "rng = np.random.default_rng(3)\nm = r.random_muscles(rng)\nx = r.random_motion(rng, m, 1001, 2e-3)\n"
        "c, g = np.arange(33).reshape(3, 11), np.ones((3, 11))\n"
        "out = [*_core.hill_jacobian(m, *x, c, g, period=2e-3), *_core.hill_states(m, *x[:3], period=2e-3),\n"
        "       *map(np.asarray, _core.hill_normal(m, *x, c, g, x[0][0], period=2e-3))]\n"
        "print(hashlib.sha256(b''.join(o.tobytes() for o in out)).hexdigest())"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", code], env=os.environ | {"PELLUCID_INSTRUCTIONS": level},
            cwd=os.path.dirname(__file__), capture_output=True, text=True, check=True,
        ).stdout
        for level in ("baseline", "avx2", "avx512")
    }  # fmt: skip
    assert len(found) == 1


def test_elastic_follows_rigid_where_nothing_moves(rng):
    for row in reference.random_muscles(rng, 8):
        row[12:14] = min(row[12], 0.3), 0.05
        muscle = _core.ElasticMuscle(row, tendon_strain=1e-4, period=1e-3)
        for a in (0.1, 0.6, 1.0):
            length = row[5] + 0.95 * row[4]
            rigid = reference.force(row, np.array([a]), np.array([length]), np.zeros(1))[0]
            assert muscle.rest(a, length) == pytest.approx(rigid, rel=2e-2)
            assert muscle.step(a, length) == pytest.approx(muscle.rest(a, length), rel=1e-6)


def test_activation_dynamics_is_the_differential_equation():
    """Against much finer steps of Euler; the error halves with the period."""
    u = np.repeat([0.0, 1.0, 0.3, 0.0], 60)
    a, fine = 0.0, []
    for x in np.repeat(u, 200):
        tau = 0.01 * (0.5 + 1.5 * a) if x > a else 0.04 / (0.5 + 1.5 * a)
        a += 5e-6 / tau * (x - a)
        fine.append(a)
    worst = []
    for steps in (1, 2, 4):
        got = _core.activation_dynamics(np.repeat(u, steps), period=1e-3 / steps)[steps - 1 :: steps]
        worst.append(np.max(np.abs(got - fine[199::200])))
    assert worst[0] < 0.035
    np.testing.assert_allclose(worst[1:], np.array(worst[:2]) / 2, rtol=0.15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameters": np.ones((3, 17))}, r"parameters: got shape \(3, 17\), expected \(m, 18\)"),
        ({"parameters": np.ones((33, 18))}, "32"),
        ({"excitation": np.ones((2, 5))}, r"excitation: got shape \(2, 5\)"),
        ({"length": np.ones((3, 4))}, "length: got shape"),
        ({"period": 0.0}, "period"),
        ({"starts": [1, 2]}, "starts"),
        ({"starts": [0, 3, 3]}, "starts"),
    ],
)
def test_misuse(change, message):
    given = {name: np.ones((3, 5)) for name in ("excitation", "length", "velocity", "moment_arm")}
    given |= {"parameters": np.ones((3, 18)), "period": 0.1} | change
    with pytest.raises(ValueError, match=message):
        _core.hill_torque(**given)


def test_misuse_of_columns():
    x = np.ones((3, 5))
    for column, message in ((np.full((3, 11), 0.5), "whole numbers"), (np.zeros((2, 11)), r"\(3, 11\)")):
        with pytest.raises(ValueError, match=message):
            _core.hill_jacobian(np.ones((3, 18)), x, x, x, x, column, np.ones((3, 11)), period=0.1)
    long = np.ones((1, 18))
    with pytest.raises(ValueError, match="1021"):
        _core.HillTorque(long, period=1e-4)
