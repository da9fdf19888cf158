"""The filter cascade against scipy.signal.sosfilt."""

import numpy as np
import pytest
from scipy import signal

from pellucid import _core

DESIGNS = {
    "order 1": signal.butter(1, 20, fs=1000, output="sos"),
    "order 4": signal.butter(4, 20, fs=1000, output="sos"),
    "order 8 band": signal.butter(4, [20, 200], "band", fs=1000, output="sos"),
    "order 16": signal.butter(16, 100, fs=1000, output="sos"),
    "elliptic": signal.ellip(6, 1, 60, 50, fs=1000, output="sos"),
}


@pytest.mark.parametrize("sos", DESIGNS.values(), ids=DESIGNS)
def test_filter_is_scipys(sos, rng):
    x = rng.standard_normal(5000)
    np.testing.assert_allclose(_core.Biquads(sos).filter(x), signal.sosfilt(sos, x), rtol=1e-12, atol=1e-13)


def test_step_is_filter_one_at_a_time(rng):
    x = rng.standard_normal(300)
    filtered = _core.Biquads(DESIGNS["order 4"]).filter(x)
    one = _core.Biquads(DESIGNS["order 4"])
    assert [one.step(value) for value in x] == filtered.tolist()
    split = _core.Biquads(DESIGNS["order 4"])
    assert [*split.filter(x[:100]), *split.filter(x[100:])] == filtered.tolist()
    split.reset()
    assert split.filter(x).tolist() == filtered.tolist()


def test_float_is_near(rng):
    """Order 4 at 3 Hz of 2 kHz, where direct form I diverges in float."""
    sos = signal.butter(4, 3, fs=2000, output="sos")
    x = rng.standard_normal(20_000).cumsum() * 0.01
    exact = signal.sosfilt(sos, x)
    got = _core.BiquadsFloat(sos).filter(x)
    assert got.dtype == np.float32
    assert np.max(np.abs(got - exact)) < 5e-3 * np.max(np.abs(exact))
    assert _core.BiquadsFloat(sos).filter(np.ones(20_000))[-1] == pytest.approx(1, abs=2e-3)


def test_one_bad_sample_does_not_stay():
    biquads = _core.Biquads(DESIGNS["order 4"])
    y = biquads.filter([1.0, np.nan, 1.0, np.inf, 1.0])
    assert np.isfinite(y).tolist() == [True, False, True, False, True]
    assert y[0] == y[2] == y[4]


@pytest.mark.parametrize(
    ("sos", "message"),
    [
        (np.ones(6), r"sos: got shape \(6,\), expected \(k, 6\)"),
        (np.ones((17, 6)), "at most 16"),
        (np.full((1, 6), 2.0), "a0"),
        ("nonsense", "sos: expected"),
    ],
)
def test_misuse(sos, message):
    with pytest.raises(ValueError, match=message):
        _core.Biquads(sos)
