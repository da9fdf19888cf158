"""Zero-phase filtering, derivatives, decimation, stretches."""

from fractions import Fraction

import numpy as np
import pytest
from scipy import signal

from pellucid.numerics.filters import central_difference, decimate, local_cubic, runs, zero_phase_lowpass
from pellucid.numerics.low_pass import butterworth, butterworth_band, chebyshev, settled

FS = 1000.0
TIME = np.arange(4000) / FS


def test_a_slow_sine_passes_without_delay():
    x = np.sin(2 * np.pi * 2.0 * TIME)
    y = zero_phase_lowpass(x, 100.0, 4, FS)
    assert np.abs(y - x)[200:-200].max() < 1e-6


def test_a_fast_sine_is_removed():
    y = zero_phase_lowpass(np.sin(2 * np.pi * 400.0 * TIME), 100.0, 4, FS)
    assert np.abs(y[200:-200]).max() < 1e-4


def test_the_derivative_of_a_parabola_is_exact_inside():
    assert central_difference(3.0 * TIME**2, FS)[1:-1] == pytest.approx(6.0 * TIME[1:-1], abs=1e-9)


def test_decimation_treats_columns_as_single_signals():
    x = np.sin(2 * np.pi * TIME[:, None] * np.arange(1.0, 18.0))
    alone = np.stack([decimate(column, 10) for column in x.T.copy()], axis=1)
    for count in range(1, 18):
        np.testing.assert_array_equal(decimate(x[:, :count].copy(), 10), alone[:, :count])
    assert decimate(x, 1) is x


@pytest.mark.parametrize("cutoff", [0.0, -1.0, 500.0, 900.0])
def test_an_impossible_cutoff_is_refused(cutoff):
    with pytest.raises(ValueError, match="half the sampling rate"):
        zero_phase_lowpass(TIME, cutoff, 4, FS)


def test_too_few_samples_are_refused():
    with pytest.raises(ValueError, match="12 samples"):
        zero_phase_lowpass(TIME[:12], 100.0, 4, FS)


def test_runs_are_the_stretches_of_true():
    assert runs(np.array([0, 1, 1, 0, 1], bool)) == [slice(1, 3), slice(4, 5)]
    assert runs(np.zeros(3, bool)) == []
    assert runs(np.ones(3, bool)) == [slice(0, 3)]


@pytest.mark.parametrize("factor", [2, 10])
def test_decimation_is_scipys(factor):
    x = np.random.default_rng(1).standard_normal(4000).cumsum()
    theirs = signal.decimate(x, factor, ftype="iir", zero_phase=True)
    assert decimate(x, factor) == pytest.approx(theirs, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("order", range(1, 13))
@pytest.mark.parametrize("cutoff", [0.003, 0.1, 0.3, 0.5, 0.9])
def test_butterworth_is_scipys(order, cutoff):
    sos = signal.butter(order, cutoff, output="sos")
    np.testing.assert_allclose(butterworth(order, cutoff), sos, rtol=1e-13, atol=1e-15)
    # SciPy's own states are only as good as its linear algebra's: at a cutoff of 0.003 an ulp grows by 1e4.
    exact, theirs = _settled_exactly(sos), signal.sosfilt_zi(sos)
    size = np.abs(exact).max(axis=1, keepdims=True)
    np.testing.assert_allclose(settled(sos) / size, exact / size, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(theirs / size, exact / size, rtol=0.0, atol=1e-10)


def _settled_exactly(sections):
    """The states of the cascade under a constant input of 1, in rational arithmetic."""
    states, level = [], Fraction(1)
    for b0, b1, b2, _, a1, a2 in ([Fraction(x) for x in section] for section in sections):
        out = level * (b0 + b1 + b2) / (1 + a1 + a2)
        states.append([float(out - b0 * level), float(b2 * level - a2 * out)])
        level = out
    return np.array(states)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("band", [(0.02, 0.45), (0.004, 0.6), (0.2, 0.21), (0.03, 0.9)])
def test_butterworth_band_is_scipys(order, band):
    sos = signal.butter(order, band, "bandpass", output="sos")
    np.testing.assert_allclose(butterworth_band(order, *band), sos, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("factor", [2, 3, 10, 50])
def test_chebyshev_is_scipys(factor):
    sos = signal.cheby1(8, 0.05, 0.8 / factor, output="sos")
    np.testing.assert_allclose(chebyshev(8, 0.05, 0.8 / factor), sos, rtol=1e-13)


@pytest.mark.parametrize("order", [1, 2, 5, 8])
@pytest.mark.parametrize("shape", [(600,), (600, 1), (600, 7)])
def test_filtering_both_ways_is_scipys(order, shape):
    x = np.random.default_rng(3).standard_normal(shape).cumsum(axis=0)
    theirs = signal.sosfiltfilt(signal.butter(order, 40.0, fs=FS, output="sos"), x, axis=0)
    np.testing.assert_allclose(zero_phase_lowpass(x, 40.0, order, FS), theirs, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("window", [5, 9, 21])
def test_a_local_cubic_is_that_of_scipy(window, rng):
    samples = np.cumsum(rng.standard_normal(300))
    np.testing.assert_allclose(local_cubic(samples, window), signal.savgol_filter(samples, window, 3), atol=1e-10)
