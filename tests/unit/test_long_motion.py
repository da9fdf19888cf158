"""Hours are taken in pieces: these hold what one pass holds, least squares on them is least squares on everything."""

import numpy as np
import pytest

from pellucid.joint.fit.friction_solver import solve_family, solve_from_part
from pellucid.models.joint import joint_model
from pellucid.numerics import motion as long_motion
from pellucid.numerics.filters import decimate, decimation_memory, lowpass_memory, zero_phase_lowpass
from pellucid.numerics.motion import Filtering, motion_of, pieces, thinned
from pellucid.numerics.regression import Stack, regression_rows, stack

FS = 500.0
FILTERING = Filtering(lowpass=20.0, order=4, decimate=5, dead_band=0.05, trim=100)


def recorded(seconds=240.0):
    rng = np.random.default_rng(3)
    time = np.arange(round(seconds * FS)) / FS
    q = 0.5 * np.sin(0.9 * time) + 0.4 * np.sin(2.3 * time + 1.0) + 0.2 * np.sin(0.11 * time)
    v, a = np.gradient(q, 1 / FS), np.gradient(np.gradient(q, 1 / FS), 1 / FS)
    load = 0.08 * a + 2.0 * np.sin(q)
    effort = load + (0.4 + 0.2 * np.exp(-((v / 0.1) ** 2)) + 0.05 * np.abs(load)) * np.sign(v) + 0.1 * v
    return time, q + 1e-5 * rng.standard_normal(len(q)), effort + 0.05 * rng.standard_normal(len(q))


def test_pieces_hold_what_one_pass_holds(monkeypatch):
    time, q, effort = recorded()
    monkeypatch.setattr(long_motion, "MIN_SAMPLES_PER_PERIOD", np.inf)  # nothing is thinned
    monkeypatch.setattr(long_motion, "PIECE_SAMPLES", 20_000)
    made = list(pieces(time, q, effort, FILTERING, fs=FS))
    whole = motion_of(time, q, effort, FILTERING, fs=FS)
    assert len(made) > 3
    inner = [m.time[m.inner] for m in made]
    np.testing.assert_allclose(np.diff(np.concatenate(inner)), 1 / FS, rtol=1e-9)
    first = np.searchsorted(whole.time, inner[0][0])
    for name in ("position", "velocity", "acceleration", "effort"):
        joined = np.concatenate([getattr(m, name)[m.inner] for m in made])
        expected = getattr(whole, name)[first : first + len(joined)]
        np.testing.assert_allclose(joined, expected, atol=1e-9 * np.abs(expected).max())
    rows = np.concatenate([m.reduce(m.effort) for m in made])
    at = (first - FILTERING.trim) // FILTERING.decimate
    assert (first - FILTERING.trim) % FILTERING.decimate == 0
    np.testing.assert_allclose(rows, whole.reduce(whole.effort)[at : at + len(rows)], atol=1e-9)


def test_a_filter_forgets_its_border():
    x = np.cumsum(np.random.default_rng(0).standard_normal(6000))
    n = lowpass_memory(4, 8.0, FS)
    near = zero_phase_lowpass(x, 8.0, 4, FS)[2000:4000], zero_phase_lowpass(x[2000 - n : 4000 + n], 8.0, 4, FS)[n:-n]
    np.testing.assert_allclose(*near, atol=1e-10 * np.abs(x).max())
    n = 5 * -(-decimation_memory(5) // 5)
    near = decimate(x, 5)[400:800], decimate(x[2000 - n : 4000 + n], 5)[n // 5 : -(n // 5)]
    np.testing.assert_allclose(*near, atol=1e-10 * np.abs(x).max())
    assert np.abs(decimate(x, 5)[400:800] - decimate(x[2000:4000], 5)).max() > 1e-4


@pytest.mark.parametrize(
    ("filtering", "samples", "thin", "decimate"),
    [
        (Filtering(60.0, 4, 20), 1000, 4, 20),
        (Filtering(20.0, 4, 1), 1000, 12, 12),
        (Filtering(20.0, 4, 7), 1000, 7, 7),
        (Filtering(None, 4, 5), 1000, 1, 5),
        (Filtering(None, 4, 1), 9_000_000, 5, 5),
        (Filtering(60.0, 4, 3), 36_000_000, 18, 18),
    ],
)
def test_thinning_leaves_what_the_low_pass_lets_through(filtering, samples, thin, decimate):
    found = thinned(filtering, 1000.0, samples)
    assert (found.thin, found.decimate) == (thin, decimate)


@pytest.mark.parametrize("family", ["symmetric", "load", "stribeck", "combined"])
def test_steps_from_a_part_end_where_a_search_on_everything_does(monkeypatch, family):
    time, q, effort = recorded()
    monkeypatch.setattr(long_motion, "PIECE_SAMPLES", 20_000)
    data = stack(list(pieces(time, q, effort, FILTERING, fs=FS)))
    top = max(np.abs(m.velocity).max() for m in data.motions)
    model = joint_model(family, motion="rotary", effort_unit="N*m", gravity="sine", velocity_range=top)
    part = Stack(data.motions[1:3], data.targets[1:3])
    found, expected = solve_from_part(model, data, solve_family(model, part)), solve_family(model, data)
    assert found.converged
    # A search over the Stribeck velocity stops early where the minimum is flat: steps may come closer.
    assert np.sum(found.residual**2) < np.sum(expected.residual**2) * (1 + 3e-6)
    if "stribeck" not in model.names:
        noise = np.sqrt(np.mean(expected.residual**2) / np.sum(expected.jacobian**2, axis=0))
        assert np.all(np.abs(found.values - expected.values) < 0.2 * noise)


@pytest.mark.parametrize("family", ["symmetric", "combined"])
def test_some_rows_of_a_regressor_are_those_of_all(monkeypatch, family):
    time, q, effort = recorded()
    monkeypatch.setattr(long_motion, "PIECE_SAMPLES", 20_000)
    data = stack(list(pieces(time, q, effort, FILTERING, fs=FS)))
    model = joint_model(family, motion="rotary", effort_unit="N*m", gravity="sine")
    values, kept = np.full(len(model.names), 0.1), np.arange(3, len(data.target), 11)
    jacobian, effort = regression_rows(model, values, data)
    some, same = regression_rows(model, values, data, kept)
    assert np.array_equal(some, jacobian[kept])
    assert np.array_equal(same, effort)
