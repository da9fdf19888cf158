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
