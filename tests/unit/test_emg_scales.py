"""Scales of EMG survive an artefact, and trials that were each divided by their own maximum are named."""

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

import pellucid as pl
from pellucid.emg.signals.emg_findings import clock_findings
from pellucid.emg.signals.emg_log import emg_log_findings
from pellucid.emg.study.muscle_channels import per_trial_faults
from pellucid.files.log import log_of
from pellucid.files.readers import read_columns
from pellucid.files.recording import Channel, Recording
from pellucid.start.init_from_files import init_from_files

RATE = 2000.0


def contraction(seed=0, seconds=6.0):
    """Return raw EMG of a maximal contraction, (n,) [V], which rises, is held and falls."""
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE)
    t = np.arange(n) / RATE
    sos = signal.butter(2, [25.0, 350.0], "bandpass", fs=RATE, output="sos")
    effort = np.clip(2.0 * np.minimum(t - 1.0, seconds - 1.0 - t), 0.02, 1.0)
    return 4e-4 * effort * signal.sosfiltfilt(sos, rng.standard_normal(n))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("seconds", [3.0, 6.0])
def test_an_artefact_of_10_ms_does_not_make_a_maximum(seed, seconds):
    x = contraction(seed, seconds)
    plain = pl.maximal_envelope([x], rate=RATE, chain="hill")
    spoilt = x.copy()
    spoilt[1000:1020] += 8e-3
    assert pl.maximal_envelope([spoilt], rate=RATE, chain="hill") == pytest.approx(plain, rel=0.02)


@pytest.mark.parametrize("chain", ["hill", "able"])
def test_the_interval_of_a_scale_covers_what_repetitions_have(chain):
    tops = [pl.maximal_envelope([contraction(seed)], rate=RATE, chain=chain) for seed in range(40)]
    expected, covered = float(np.mean(tops)), 0
    for seed in range(12):
        top, low, high = pl.maximal_envelope([contraction(seed)], rate=RATE, chain=chain, level=0.95)
        assert low < top < high
        assert top == pytest.approx(tops[seed])
        covered += low <= expected <= high
    assert covered >= 10
    # The spread that the interval states is that of repetitions.
    assert 0.5 < (high - low) / top / (3.92 * np.std(tops) / expected) < 2.0


def test_more_muscles_and_contractions_have_an_interval_each():
    x = np.column_stack([contraction(0), contraction(1)])
    top, low, high = pl.maximal_envelope([x, x[:, ::-1]], rate=RATE, chain="hill", level=0.9)
    assert top.shape == low.shape == high.shape == (2,)
    with pytest.raises(pl.PellucidError, match="level"):
        pl.maximal_envelope([x], rate=RATE, chain="hill", level=95.0)


def trial(tmp_path, name, envelope):
    channels = {
        "time": Channel("time", np.arange(len(envelope)) / 100.0, "s", "t"),
        "emg.soleus": Channel("emg.soleus", envelope, "1", "s"),
    }
    return Recording(name, tmp_path / f"{name}.csv", "", "fit", channels)


def test_trials_that_are_each_divided_by_their_own_maximum_are_named(tmp_path):
    made = [np.abs(np.sin(np.arange(300) / (20.0 + k))) for k in range(3)]
    own = [trial(tmp_path, f"walk{k}", x / x.max()) for k, x in enumerate(made)]
    (fault,) = per_trial_faults(own)
    assert fault.kind == "normalised_per_trial"
    shared = [trial(tmp_path, f"walk{k}", x * (1.0 - 0.1 * k) / x.max()) for k, x in enumerate(made)]
    assert per_trial_faults(shared) == []


def envelope_file(tmp_path, name, columns):
    """Write relative envelopes, (n, 3) [%], of three muscles."""
    rows = (f"{i / 100:.2f}," + ",".join(f"{x:.6f}" for x in row) for i, row in enumerate(columns.tolist()))
    path = tmp_path / f"{name}.csv"
    path.write_text("time_s,VL_percent,BF_percent,TA_percent\n" + "\n".join(rows) + "\n")
    return path


def envelopes(seed, n=600):
    phase = np.random.default_rng(seed).uniform(0.0, 6.0, 3)
    i = np.arange(n)[:, None]
    return 0.02 + np.clip(np.sin(i / 17.0 + phase), 0.0, None) ** 2 * (1.0 + 0.1 * np.sin(i / 61.0))


def test_the_own_maximum_of_a_single_recording_is_named_by_every_door(tmp_path):
    x = envelopes(0)
    path = envelope_file(tmp_path, "walk", 100.0 * x / x.max(axis=0))
    verdicts = pl.audit([path]).verdicts
    audited = {v.channel for v in verdicts for _, f in v.findings if f.kind == "normalised_per_trial"}
    assert len(audited) == 3
    assert {v.holds for v in verdicts if v.channel in audited} == {"emg [%]"}
    made = init_from_files(tmp_path / "study", [path])
    assert {f.channel for f in made.faults if f.kind == "normalised_per_trial"} == {
        "emg.vastus_lateralis", "emg.biceps_femoris", "emg.tibialis_anterior",
    }  # fmt: skip


def test_a_maximum_that_one_of_several_recordings_reaches_is_that_of_all(tmp_path):
    trials = [envelopes(k) for k in range(3)]
    top = np.max([x.max(axis=0) for x in trials], axis=0)
    paths = [envelope_file(tmp_path, f"walk{k}", 100.0 * x / top) for k, x in enumerate(trials)]
    assert not [f for v in pl.audit(paths).verdicts for _, f in v.findings if f.kind == "normalised_per_trial"]
    made = init_from_files(tmp_path / "study", paths)
    assert not [f for f in made.faults if f.kind == "normalised_per_trial"]


def test_lost_samples_are_a_gap_of_the_clock_and_both_rates_are_told(tmp_path):
    t = np.delete(np.arange(20000) / RATE, np.r_[9000:9600, 12000:12900])
    (one,) = clock_findings("time", t)
    assert one.kind == "clock"
    assert "1500 samples lost in 2 gaps" in one.found
    assert one.size == pytest.approx(0.75, abs=0.01)
    assert clock_findings("time", np.arange(2000) / RATE, RATE) == []
    assert "states 2000 Hz" in clock_findings("time", np.arange(2000) / 1901.0, RATE)[0].found
    x = contraction(seconds=10.0)[: len(t)]
    path = tmp_path / "lost.csv"
    path.write_text("time_s,VL_mV\n" + "".join(f"{a:.6f},{1e3 * b:.6f}\n" for a, b in zip(t, x, strict=True)))
    assert "clock" in {each.kind for each in emg_log_findings(log_of(read_columns(Path(path))))}
