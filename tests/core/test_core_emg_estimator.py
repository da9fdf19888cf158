"""The estimator that steps: the same as muscles over arrays, a map as NumPy has it, stiffness as its own derivative."""

import numpy as np
import pytest
from scipy import signal
from scipy.interpolate import NdBSpline

from pellucid import _core

FS, N = 100.0, 400
SOS = signal.butter(2, 12.0, fs=FS, output="sos")
AXES = np.array([[[0, 1.0, 0.0, -1.5, 0.25, 8], [0] * 6], [[0, -1.0, 0.1, -1.0, 0.3, 7], [1, 1.0, 0.0, -0.8, 0.2, 8]]])


def surfaces():
    rng = np.random.default_rng(1)
    one = 0.36 + 0.03 * np.sin(0.5 * np.arange(11)) + 0.001 * rng.standard_normal(11)
    i, j = np.meshgrid(np.arange(10), np.arange(11), indexing="ij")
    return [one, (0.42 - 0.01 * i + 0.008 * j + 0.0005 * rng.standard_normal(i.shape)).ravel()]


def muscles():
    fields = {f["name"]: f["default"] for f in _core.model_fields()["muscle"]}
    own = {"shape": -1.2, "time_constant_1": 0.02, "time_constant_2": 0.03, "delay": 0.034, "damping": 0.05,
           "max_isometric_force": 1500.0, "pennation": 0.2}  # fmt: skip
    rows = [{"optimal_fibre_length": 0.1, "tendon_slack_length": 0.25},
            {"optimal_fibre_length": 0.12, "tendon_slack_length": 0.27}]  # fmt: skip
    return np.array([[{**fields, **own, **row}[name] for name in _core.MUSCLE_PARAMETER_NAMES] for row in rows])


def made(**changed):
    told = {
        "channels": [[1.0, 0.0, 1.0]] * 2, "angles": 2, "muscles": muscles(), "shares": [[0.8, 0.0], [0.25, 0.25]],
        "axes": AXES, "surfaces": surfaces(), "joints": [[0, 3.0, 5.0, 0.4, 500.0], [1, 0.0, 0.0, 0.0, 500.0]],
        "terms": [[], []], "lags": [], "motion": SOS, "period": 1 / FS, "patience": 5,
    }  # fmt: skip
    return {**told, **changed}


def movement(seed=0):
    t = np.arange(N) / FS
    rng = np.random.default_rng(seed)
    envelope = 0.5 + 0.4 * np.sin(2 * np.pi * np.outer([1.1, 0.7], t) + rng.uniform(0, 6, (2, 1)))
    angle = np.array([-0.4 + 0.6 * np.sin(2 * np.pi * 0.9 * t), 0.3 * np.sin(2 * np.pi * 0.6 * t + 1)])
    return np.round(1e6 * t), envelope, angle


def paths(angle):
    return [_core.muscle_path(axes, surface, angle) for axes, surface in zip(AXES, surfaces(), strict=True)]


def rates(angle):
    smooth = np.array([signal.sosfilt(SOS, q, zi=signal.sosfilt_zi(SOS) * q[0])[0] for q in angle])
    return smooth, FS * np.diff(smooth, prepend=smooth[:, :1])


def test_paths_are_splines():
    angle = movement()[2]
    grid = tuple(start + step * np.arange(-3, cells + 4) for _, _, _, start, step, cells in AXES[1])
    spline = NdBSpline(grid, surfaces()[1].reshape(10, 11), 3)
    length, slope, bend = paths(angle)[1]
    q = np.stack([0.1 - angle[0], angle[1]], axis=-1)
    assert np.allclose(length, spline(q), rtol=1e-13, atol=0)
    assert np.allclose(slope, [-spline(q, nu=[1, 0]), spline(q, nu=[0, 1])], atol=1e-13)
    assert np.allclose(bend[0, 1], -spline(q, nu=[1, 1]), atol=1e-12)
    assert np.allclose(bend[0, 0], spline(q, nu=[2, 0]), atol=1e-12)


def test_it_is_the_sum_over_arrays_for_every_joint():
    time, envelope, angle = movement()
    torque, fault, _, _ = _core.EmgEstimator(**made()).run(time, envelope, angle)
    excitation = np.array([0.8 * envelope[0], 0.25 * envelope.sum(axis=0)])
    (one, two), (_, speed) = paths(angle), rates(angle)
    length = np.array([one[0], two[0]])
    rate = np.array([one[1][0] * speed[0], two[1][0] * speed[0] + two[1][1] * speed[1]])
    arms = np.array([[-one[1][0], -two[1][0]], [0 * angle[0], -two[1][1]]])
    for joint, passive in enumerate((3.0 - 5.0 * angle[0] - 0.4 * speed[0], 0.0)):
        wanted = _core.hill_torque(muscles(), excitation, length, rate, arms[joint], period=1 / FS) + passive
        assert np.max(np.abs(torque[joint] - wanted)) < 1e-12 * np.max(np.abs(wanted))
    assert list(fault) == [_core.EMG_FAULTS.index("restarted")] + [0] * (N - 1)


def test_steps_are_the_run_and_float_is_near():
    time, envelope, angle = movement(1)
    whole = _core.EmgEstimator(**made()).run(time, envelope, angle)
    stepped, single = _core.EmgEstimator(**made()), _core.EmgEstimatorFloat(**made())
    for k in range(N):
        torque, *_ = stepped.step(int(time[k]), envelope[:, k], angle[:, k])
        assert torque.tolist() == whole[0][:, k].tolist()
        near, *_ = single.step(int(time[k]), envelope[:, k], angle[:, k])
        assert np.allclose(near, torque, atol=0.05)
    assert np.array_equal(stepped.stiffness()[1], whole[3][:, :, -1])
    assert stepped.forces.shape == (2,)
    stepped.reset()
    assert np.array_equal(stepped.run(time, envelope, angle)[0], whole[0])


def test_a_map_of_products_with_lags():
    time, envelope, angle = movement(2)
    # Features: each channel now and 5 samples ago, then angle, speed, acceleration of each angle.
    terms = [[[2.0, -1, -1], [7.0, 0, -1], [-3.0, 1, -1], [1.5, 4, 2], [0.2, 5, -1], [0.05, 9, 9]], []]
    told = made(muscles=np.zeros((0, 18)), shares=np.zeros((0, 2)), axes=np.zeros((0, 2, 6)), surfaces=[], terms=terms,
                lags=[5], joints=[[0, 0, 0, 0, 1e4], [1, 0, 0, 0, 1e4]])  # fmt: skip
    torque = _core.EmgEstimator(**told).run(time, envelope, angle)[0]
    smooth, speed = rates(angle)
    late = np.concatenate((np.full(5, envelope[0, 0]), envelope[0, :-5]))
    bent = FS * np.diff(speed[1], prepend=speed[1, 0])
    wanted = 2 + 7 * envelope[0] - 3 * late + 1.5 * smooth[0] * envelope[1] + 0.2 * speed[0] + 0.05 * bent**2
    assert np.allclose(torque[0], wanted, rtol=0, atol=1e-10)
    assert not np.any(torque[1])


def test_stiffness_is_the_derivative_of_the_torque():
    """At rest, with everything settled: Hill's slope is what a joint moved a little pulls back with."""
    told = made(muscles=muscles(), motion=np.array([[1.0, 0, 0, 1, 0, 0]]))
    shape = [f["name"] for f in _core.model_fields()["muscle"]].index("damping")
    told["muscles"][:, shape] = 0.0

    def settled(q):
        estimator = _core.EmgEstimator(**told)
        held = np.tile(np.array(q)[:, None], 200), np.full((2, 200), 0.4)
        return estimator.run(1e4 * np.arange(200), held[1], held[0])[0][:, -1], estimator.stiffness()

    q, h = np.array([-0.3, 0.1]), 1e-5
    _, (short, slope) = settled(q)
    numeric = np.array([(settled(q - h * e)[0] - settled(q + h * e)[0]) / (2 * h) for e in np.eye(2)]).T
    assert np.allclose(slope, numeric, rtol=1e-6, atol=1e-4)
    assert np.allclose(slope, slope.T)
    assert short[0, 0] > slope[0, 0] > 0


def test_raw_emg_passes_the_filters():
    rng = np.random.default_rng(3)
    before, after = (
        signal.butter(2, (30, 450), "bandpass", fs=1000, output="sos"),
        signal.butter(2, 5, fs=1000, output="sos"),
    )
    raw = 1e-3 * rng.standard_normal((2000, 2))
    told = made(channels=[[400.0, 0.0, 1.0]] * 2, before=before, after=after)
    estimator = _core.EmgEstimator(**told)
    for k in range(200):
        estimator.listen(raw[10 * k : 10 * k + 10])
        *_, fault, lost, above, blind = estimator.step(10_000 * k, [0, 0], [-0.3, 0.1])
    wanted = 400 * signal.sosfilt(after, np.abs(signal.sosfilt(before, raw, axis=0)), axis=0)[-1]
    assert np.allclose(estimator.levels, wanted, rtol=1e-12)
    assert (fault, lost, above, blind) == (0, 0, 0, 0)
    for k in range(200, 206):  # nothing comes any more
        *_, fault, lost, _, _ = estimator.step(10_000 * k, [0, 0], [-0.3, 0.1])
    assert (_core.EMG_FAULTS[fault], lost) == ("channel", 3)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"channels": [[1.0, 0.0]]}, "channels: got shape"),
        ({"surfaces": [np.zeros(3), np.zeros(3)]}, "surfaces: got 3 coefficients, expected 11"),
        ({"joints": [[7, 0, 0, 0, 1.0], [1, 0, 0, 0, 1.0]]}, "angles that exist"),
        ({"terms": [[[1.0, 99, -1]], []]}, "features"),
        ({"period": -1.0}, "period"),
        ({"lags": [999]}, "lags"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(changed, message):
    with pytest.raises(ValueError, match=message):
        _core.EmgEstimator(**made(**changed))
