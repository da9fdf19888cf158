"""Array functions of EMG: the trend of the median frequency, and ensembles of strides."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

import pellucid as pl
from pellucid._errors import RecordingError

FS = 2000.0


def tiring(rng, fall, seconds=30.0):
    """Return noise whose band moves down by `fall` [Hz/s], block by block."""
    blocks = []
    for i in range(round(2.0 * seconds)):
        middle = 110.0 - fall * (0.5 * i + 0.25)
        sos = butter(2, (middle - 30.0, middle + 30.0), "bandpass", fs=FS, output="sos")
        blocks.append(sosfilt(sos, rng.standard_normal(2000))[-1000:])
    return 1e-4 * np.concatenate(blocks)


@pytest.mark.parametrize("fall", [0.0, 0.5, 1.0])
def test_the_slope_of_the_median_frequency_is_that_of_the_band(fall):
    rng = np.random.default_rng(4)
    found = [pl.median_frequency_trend(tiring(rng, fall), rate=FS) for _ in range(20)]
    assert np.mean([each.slope for each in found]) == pytest.approx(-fall, abs=0.05)
    # Of 20 intervals at 95 % fewer than 16 hold the truth once in 400 times.
    assert sum(each.low <= -fall <= each.high for each in found) >= 16
    assert found[0].initial == pytest.approx(107.0, abs=6.0)
    assert found[0].median_frequency.shape == found[0].time.shape == (30,)


@pytest.mark.parametrize(
    ("emg", "rate", "said"),
    [
        (np.full(20000, np.nan), FS, "missing samples"),
        (np.zeros((20000, 2)), FS, r"expected \(n,\)"),
        (np.ones(20000), FS, "expected raw EMG"),
        (np.sin(np.arange(20000.0)), 500.0, "rate of 500 Hz"),
        (np.sin(np.arange(5000.0)), FS, "expected at least 4 windows"),
    ],
)
def test_what_has_no_median_frequency_is_refused(emg, rate, said):
    with pytest.raises(RecordingError, match=said):
        pl.median_frequency_trend(emg, rate=rate)


def test_strides_of_several_durations_are_one_ensemble():
    events = np.array([0.2, 1.2, 2.4, 3.3])
    time = np.arange(0.0, 4.0, 0.001)
    phase = np.interp(time, events, np.arange(4.0), left=0.0, right=3.0)
    both = np.column_stack([np.sin(2.0 * np.pi * phase), np.cos(2.0 * np.pi * phase)])
    found = pl.stride_ensemble(both, rate=1000.0, events=events)
    np.testing.assert_allclose(found.mean[:, 0], np.sin(2.0 * np.pi * found.phase), atol=2e-3)
    assert found.deviation.max() < 5e-3
    np.testing.assert_allclose(found.duration, [1.0, 1.2, 0.9])
    assert found.strides.shape == (3, 101, 2)


@pytest.mark.parametrize("events", [[0.0, 1.0], [0.0, 2.0, 1.0], [0.0, 1.0, 9.0]])
def test_events_that_make_no_strides_are_refused(events):
    with pytest.raises(RecordingError, match="expected at least three that rise"):
        pl.stride_ensemble(np.zeros(500), rate=100.0, events=events)
