"""Optimised Fourier excitations: closed-form derivatives, limits that hold, motions better than others."""

import numpy as np
import pytest

from pellucid.numerics.protocols.excitation import multisine
from pellucid_lab.fourier import (
    EXCITATION_CRITERIA,
    FourierSeries,
    optimised_fourier,
    play,
    scaled_to_limits,
)

LIMITS = {"low": -0.2, "high": 1.8, "velocity": 4.0, "acceleration": 25.0}
FUNDAMENTAL, HARMONICS = 0.3, 5
# Typical inertia, gravity (two), Coulomb and viscous friction of an elbow: columns in N m.
SCALES = np.array([0.05, 3.0, 0.5, 0.3, 0.2])


def regressor(position, velocity, acceleration):
    return np.column_stack([acceleration, np.sin(position), np.cos(position), np.sign(velocity), velocity])


def optimised(seed=0, **options):
    options = {"fundamental": FUNDAMENTAL, "harmonics": HARMONICS, "scales": SCALES, **LIMITS, **options}
    return optimised_fourier(options.pop("regressor", regressor), rng=np.random.default_rng(seed), **options)


def random_series(seed, harmonics=HARMONICS, **limits):
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((2, harmonics))
    return scaled_to_limits(a, b, fundamental=FUNDAMENTAL, **{**LIMITS, **limits})


def excitation_cost(matrix, criterion="condition", scales=None):
    """A criterion by its definition: without scales, columns count by their direction alone."""
    if criterion == "determinant":
        scaled = matrix if scales is None else matrix * scales
        return -np.linalg.slogdet(scaled.T @ scaled / len(matrix))[1]
    return np.linalg.cond(matrix / np.linalg.norm(matrix, axis=0) if scales is None else matrix * scales)


def cost(series, criterion):
    # Other instants than the search's own.
    time = (np.arange(317) + 0.37) / 317 * series.period
    return excitation_cost(regressor(*series.motion(time)), criterion, scales=SCALES)


def assert_within(position, fs, velocity, acceleration):
    assert np.abs(np.diff(position) * fs).max() <= velocity * (1 + 1e-9)
    assert np.abs(np.diff(position, 2) * fs**2).max() <= acceleration * (1 + 1e-6)


@pytest.fixture(scope="module", params=EXCITATION_CRITERIA)
def criterion(request):
    return request.param


@pytest.fixture(scope="module")
def best(criterion):
    return optimised(criterion=criterion)


def test_series_is_the_one_written():
    series = FourierSeries(0.5, 0.1, np.array([0.3, 0.0]), np.array([0.0, 0.8]))
    time = np.linspace(0.0, 3.0, 50)
    position, velocity, _ = series.motion(time)
    w = np.pi
    np.testing.assert_allclose(position, 0.1 + 0.3 / w * np.sin(w * time) - 0.8 / (2 * w) * np.cos(2 * w * time))
    np.testing.assert_allclose(velocity, 0.3 * np.cos(w * time) + 0.8 * np.sin(2 * w * time), atol=1e-14)


def test_derivatives_match_central_differences():
    series, step = random_series(3), 1e-5
    time = np.random.default_rng(4).uniform(0.0, 10.0, 300)
    before, here, after = (series.motion(time + s) for s in (-step, 0.0, step))
    np.testing.assert_allclose((after[0] - before[0]) / (2 * step), here[1], atol=1e-7)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * step), here[2], atol=1e-6)


@pytest.mark.parametrize("harmonics", [1, 2, 5, 20])
@pytest.mark.parametrize("binding", ["range", "velocity", "acceleration"])
def test_scaling_touches_the_binding_limit_and_exceeds_none(harmonics, binding):
    far = {"low": -100.0, "high": 300.0, "velocity": 1e3, "acceleration": 1e5}
    near = {"range": {"low": -0.5, "high": 1.0}, "velocity": {"velocity": 0.7}, "acceleration": {"acceleration": 2.0}}
    limits = {**far, **near[binding]}
    position, velocity, acceleration = random_series(harmonics, harmonics, **limits).motion(np.linspace(0, 4, 40_001))
    used = {
        "range": np.ptp(position) / (limits["high"] - limits["low"]),
        "velocity": np.abs(velocity).max() / limits["velocity"],
        "acceleration": np.abs(acceleration).max() / limits["acceleration"],
    }
    assert max(used.values()) <= 1.0 + 1e-12
    assert max(used, key=used.get) == binding
    assert used[binding] > 0.998
    middle = 0.5 * (limits["low"] + limits["high"])
    assert 0.5 * (position.min() + position.max()) == pytest.approx(middle, abs=2e-3 * np.ptp(position))


def test_peaks_bound_every_instant():
    series = random_series(8)
    low, high, speed, change = series.peaks()
    position, velocity, acceleration = series.motion(np.linspace(0.0, series.period, 100_001))
    for bound, value in (
        (-low, -position.min()),
        (high, position.max()),
        (speed, np.abs(velocity).max()),
        (change, np.abs(acceleration).max()),
    ):
        assert value <= bound == pytest.approx(value, rel=2e-3, abs=2e-3)


def test_optimised_motion_keeps_the_limits_and_uses_one(best):
    position, velocity, acceleration = best.motion(np.linspace(0.0, best.period, 50_001))
    assert LIMITS["low"] <= position.min()
    assert position.max() <= LIMITS["high"]
    used = (np.ptp(position) / 2.0, np.abs(velocity).max() / 4.0, np.abs(acceleration).max() / 25.0)
    assert 0.998 < max(used) <= 1.0 + 1e-12


def test_condition_is_half_that_of_random_motions_and_beats_a_multisine():
    found = cost(optimised(), "condition")
    assert found <= 0.5 * np.median([cost(random_series(s), "condition") for s in range(100)])
    fs = 1000.0
    for seed in range(8):
        position = multisine(
            20.0,
            fs,
            fundamental=FUNDAMENTAL,
            harmonics=HARMONICS,
            amplitude=1.0,
            centre=0.8,
            rng=np.random.default_rng(seed),
        )
        velocity = np.gradient(position, 1 / fs)
        whole = slice(5000, 15000, 10)  # three periods, after easing in
        matrix = regressor(position[whole], velocity[whole], np.gradient(velocity, 1 / fs)[whole])
        assert found < excitation_cost(matrix, scales=SCALES)


def test_each_criterion_improves_what_it_optimises(best, criterion):
    other = optimised(criterion=next(c for c in EXCITATION_CRITERIA if c != criterion))
    assert cost(best, criterion) < min(cost(random_series(s), criterion) for s in range(100))
    assert cost(best, criterion) < cost(other, criterion)


def test_without_scales_only_collinearity_counts():
    series = optimised(scales=None)
    matrix = regressor(*series.motion(np.linspace(0.0, series.period, 200, endpoint=False)))
    random = [random_series(s).motion(np.linspace(0.0, series.period, 200, endpoint=False)) for s in range(100)]
    assert excitation_cost(matrix) < min(excitation_cost(regressor(*motion)) for motion in random)


def test_same_seed_same_motion():
    one, two, three = (optimised(s, restarts=2) for s in (5, 5, 6))
    np.testing.assert_array_equal(one.a, two.a)
    np.testing.assert_array_equal(one.b, two.b)
    assert one.centre == two.centre
    assert not np.array_equal(one.a, three.a)


@pytest.mark.parametrize("restarts", [1, 8])
def test_the_search_is_bounded(restarts):
    calls = 0

    def seven(position, velocity, acceleration):
        nonlocal calls
        calls += 1
        more = (velocity * np.abs(velocity), np.ones_like(position))
        return np.column_stack([regressor(position, velocity, acceleration), *more])

    optimised(regressor=seven, scales=None, restarts=restarts)
    assert calls < 7000


@pytest.mark.parametrize("seed", range(5))
def test_played_motion_rests_at_both_ends_and_keeps_the_limits(seed):
    series, fs = random_series(seed), 1000.0
    position = play(series, 20.0, fs)
    low, high, speed, change = series.peaks()
    assert position.shape == (20_000,)
    assert low <= position.min()
    assert position.max() <= high
    assert_within(position, fs, speed, change)
    for end in (position, position[::-1]):
        assert end[0] == series.centre
        # The excursion starts with the third power of time: rate and change of rate start at zero.
        assert np.abs(np.diff(end[:3])).max() * fs < 1e-3 * speed
        assert abs(np.diff(end[:3], 2)[0]) * fs**2 < 1e-2 * change


def test_between_the_easings_the_series_itself_is_played():
    series, fs = random_series(1), 1000.0
    ease = 1.5 * series.period
    time = np.arange(20_000) / fs
    whole = (time > ease) & (time < time[-1] - ease)
    np.testing.assert_array_equal(play(series, 20.0, fs, ease, acceleration=30.0)[whole], series.motion(time)[0][whole])


def test_hasty_easing_is_refused():
    series = random_series(0)
    with pytest.raises(ValueError, match=r"eased over 0\.05 s the motion reaches .* ease for longer"):
        play(series, 20.0, 500.0, 0.05)
    with pytest.raises(ValueError, match=r"the limits are 0\.5 and"):
        play(series, 30.0, 500.0, velocity=0.5)
    assert np.isfinite(play(series, 20.0, 500.0, 0.05, velocity=1e3, acceleration=1e5)).all()
    with pytest.raises(ValueError, match=r"takes 6\.\d+ s; the samples span 4\.998 s"):
        play(series, 5.0, 500.0)
    with pytest.raises(ValueError, match="ease is -1"):
        play(series, 5.0, 500.0, -1.0)
    with pytest.raises(ValueError, match="fs is 0"):
        play(series, 5.0, 0.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fundamental": 0.0}, "fundamental is 0"),
        ({"harmonics": 0}, "harmonics is 0; expected an integer >= 1"),
        ({"harmonics": 2.5}, "harmonics is 2.5"),
        ({"low": 2.0}, "low is 2.0 and high 1.8"),
        ({"high": np.nan}, "high nan"),
        ({"velocity": -1.0}, "velocity is -1"),
        ({"acceleration": np.inf}, "acceleration is inf"),
        ({"criterion": "trace"}, "criterion is 'trace'; expected one of condition, determinant"),
        ({"samples": 10}, "samples is 10; expected an integer >= 11"),
        ({"restarts": 0}, "restarts is 0"),
        ({"scales": np.ones(4)}, r"shape \(4,\); the regressor has 5 columns"),
        ({"scales": np.zeros(5)}, "scales holds"),
        ({"regressor": lambda q, v, a: q}, r"gives shape \(200,\) for 200 samples"),
        ({"regressor": lambda q, v, a: regressor(q, v, a) * np.nan}, "not finite"),
        ({"regressor": lambda q, v, a: np.column_stack([v, v, a, 2 * a, q])}, "linearly dependent on every motion"),
    ],
)
def test_bad_arguments_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        optimised(**options)


def test_bad_series_and_matrices_are_refused():
    with pytest.raises(ValueError, match=r"a has shape \(2,\) and b \(3,\)"):
        FourierSeries(1.0, 0.0, np.ones(2), np.ones(3))
    with pytest.raises(ValueError, match="not finite"):
        FourierSeries(1.0, 0.0, np.array([np.nan]), np.ones(1))
    with pytest.raises(ValueError, match="centre is inf"):
        FourierSeries(1.0, np.inf, np.ones(1), np.ones(1))
    with pytest.raises(ValueError, match="a shape that moves"):
        scaled_to_limits(np.zeros(2), np.zeros(2), fundamental=1.0, **LIMITS)
