"""Raw EMG made from excitations: its spectrum, what is mixed into it, its converter; the same samples as a stream."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import welch

from pellucid_lab.emg_synthesis import Electrodes, EmgSynthesis, motor_unit_noise
from pellucid_lab.knee.rig import knee_orthosis

PERIOD = 2e-3
TABLE = dict(knee_orthosis()["emg"])
QUIET = TABLE | dict(baseline=0.0, hum=0.0, artefact=0.0, crosstalk=0.0)
PERIODS = 10_000


def made(table, amplitude, acceleration=None, gains=(3e-4, 4e-4), seed=1, **settings):
    """Volts of a trial, shape (k, channels), and the synthesis."""
    synthesis = EmgSynthesis(Electrodes(gains, table, **settings), PERIODS, PERIOD, np.random.default_rng(seed))
    strength = np.broadcast_to(np.asarray(amplitude, float), (PERIODS, len(gains)))
    acceleration = np.zeros(PERIODS) if acceleration is None else acceleration
    return synthesis.quantum * synthesis.whole(strength, acceleration), synthesis


def test_noise_has_unit_variance_and_the_median_asked_for(rng):
    for fs, median in ((2048.0, 95.0), (1000.0, 70.0), (4000.0, 120.0)):
        x = motor_unit_noise(200_000, 2, fs, TABLE | dict(median_frequency=median), rng)
        assert x.shape == (2, 200_000)
        assert np.std(x, axis=1) == pytest.approx([1.0, 1.0], rel=0.03)
        f, power = welch(x[0], fs, nperseg=4096)
        share = np.cumsum(power)
        assert np.interp(0.5, share / share[-1], f) == pytest.approx(median, rel=0.05)
        assert abs(np.corrcoef(x)[0, 1]) < 0.03


def test_band_of_the_amplifier(rng):
    f, power = welch(motor_unit_noise(400_000, 1, 4096.0, TABLE, rng)[0], 4096.0, nperseg=8192)
    level = np.max(power)
    assert power[np.searchsorted(f, 2.0)] < 1e-3 * level
    assert power[np.searchsorted(f, 1200.0)] < 1e-3 * level


def test_amplitude_is_gain_times_excitation():
    x, _ = made(QUIET, (0.5, 0.25))
    assert np.std(x, axis=0) == pytest.approx([1.5e-4, 1e-4], rel=0.05)
    assert np.abs(np.corrcoef(x.T)[0, 1]) < 0.03


def test_strength_follows_the_excitation_in_time():
    amplitude = np.zeros((PERIODS, 2))
    amplitude[5000:7000, 0] = 1.0
    x, synthesis = made(QUIET, amplitude)
    on = (synthesis.time > 10.0) & (synthesis.time < 14.0)
    assert np.std(x[on, 0]) == pytest.approx(3e-4, rel=0.05)
    assert not x[~on & (np.abs(synthesis.time - 12.0) > 2.01)].any()


def test_crosstalk_is_a_share_of_the_other_muscle():
    x, _ = made(QUIET | dict(crosstalk=0.1), (0.0, 1.0))
    assert np.std(x[:, 0]) == pytest.approx(0.1 * np.std(x[:, 1]), rel=0.01)
    assert np.corrcoef(x.T)[0, 1] > 0.999


def test_hum_and_its_harmonics():
    x, synthesis = made(QUIET | dict(hum=1e-5, quantum=1e-12), (0.0, 0.0))
    spectrum = np.abs(np.fft.rfft(x[:, 0] * np.hanning(len(x)))) * 4.0 / len(x)
    f = np.fft.rfftfreq(len(x), 1.0 / 2048.0)
    lines = [spectrum[np.abs(f - 50.0 * i) < 0.2].max() for i in (1, 2, 3)]
    assert 0.4e-5 < lines[0] < 1.6e-5
    assert np.array(lines) / lines[0] == pytest.approx([1.0, 0.25, 0.35], rel=0.05)
    assert spectrum[(f > 60.0) & (f < 90.0)].max() < 1e-3 * lines[0]
    assert synthesis.time[1] == 1.0 / 2048.0


def test_cables_swing_slowly_with_the_leg():
    t = PERIOD * np.arange(PERIODS)
    slow, _ = made(QUIET | dict(artefact=1e-5), (0.0, 0.0), 10.0 * np.sin(2 * np.pi * 1.0 * t))
    fast, _ = made(QUIET | dict(artefact=1e-5), (0.0, 0.0), 10.0 * np.sin(2 * np.pi * 100.0 * t))
    assert 4e-5 < np.std(slow[:, 0]) < 1.1e-4
    assert np.std(fast[:, 0]) < 0.25 * np.std(slow[:, 0])


def test_converter_has_steps_and_a_range():
    x, synthesis = made(TABLE | dict(full_range=2e-4), (1.0, 1.0))
    counts = x / synthesis.quantum
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert np.max(np.abs(x)) <= 2e-4
    assert np.count_nonzero(np.abs(x[:, 1]) > 2e-4 - 1e-7) > 100


def test_one_channel_clips_alone():
    x, _ = made(TABLE, (1.0, 1.0), clipped={1: 1e-4})
    assert np.max(np.abs(x), axis=0)[1] <= 1e-4
    assert np.max(np.abs(x), axis=0)[0] > 5e-4


def test_a_detached_electrode_hears_mains_and_no_muscle():
    x, synthesis = made(TABLE, (1.0, 1.0), detached={0: 10.0})
    before, after = synthesis.time < 10.0, synthesis.time >= 10.0
    f, power = welch(x[after, 0], 2048.0, nperseg=4096)
    mains = sum(power[np.abs(f - 50.0 * i) < 2.0].sum() for i in (1, 2, 3))
    assert mains > 0.9 * power.sum()
    f, power = welch(x[before, 0], 2048.0, nperseg=4096)
    assert sum(power[np.abs(f - 50.0 * i) < 2.0].sum() for i in (1, 2, 3)) < 0.2 * power.sum()
    assert np.std(x[after, 1]) == pytest.approx(np.std(x[before, 1]), rel=0.05)


@pytest.mark.parametrize("rate", [2048.0, 1000.0, 333.0])
def test_the_stream_is_the_whole(rate):
    """Period by period or at once: the same counts, each sample in the period in which it is taken."""
    rng = np.random.default_rng(3)
    table = TABLE | dict(artefact=1e-5, clock_drift=0.0)
    electrodes = Electrodes((3e-4, 4e-4), table, rate=rate, detached={0: 0.7}, clipped={1: 3e-4})
    amplitude, acceleration = rng.uniform(0, 1, (500, 2)), 10.0 * rng.standard_normal(500)
    whole = EmgSynthesis(electrodes, 500, PERIOD, np.random.default_rng(5))
    counts = whole.whole(amplitude, acceleration)
    stream = EmgSynthesis(electrodes, 500, PERIOD, np.random.default_rng(5))
    got, sizes = [], []
    for k in range(500):
        samples = stream.period(k, amplitude[k].tolist(), float(acceleration[k]))
        assert all(k * PERIOD <= stream.time[len(got) + i] + 1e-9 for i in range(len(samples)))
        got += samples
        sizes.append(len(samples))
    np.testing.assert_array_equal(np.round(np.array(got) / whole.quantum), counts)
    assert set(sizes) == {int(rate * PERIOD), int(rate * PERIOD) + (rate % 500 > 0)}
    assert len(whole.time) == len(counts)


def test_three_muscles_and_a_seed():
    x, _ = made(TABLE, (0.2, 0.5, 1.0), gains=(1e-4, 2e-4, 3e-4))
    again, _ = made(TABLE, (0.2, 0.5, 1.0), gains=(1e-4, 2e-4, 3e-4))
    other, _ = made(TABLE, (0.2, 0.5, 1.0), gains=(1e-4, 2e-4, 3e-4), seed=2)
    assert x.shape[1] == 3
    np.testing.assert_array_equal(x, again)
    assert not np.array_equal(x, other)


def test_the_amplifiers_clock_drifts():
    table = TABLE | dict(clock_drift=0.01)
    _, drifting = made(table, (0.0, 0.0))
    _, usual = made(TABLE, (0.0, 0.0))
    assert len(drifting.time) == pytest.approx(len(usual.time) / 1.01, rel=1e-3)
    assert replace(Electrodes((1.0,), TABLE), rate=100.0).fs == 100.0
