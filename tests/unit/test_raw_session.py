"""Raw EMG against that which was fitted: spectrum, mains, rails and cross-talk."""

import numpy as np
import pytest
from made_emg import FS, raw_emg
from scipy import signal

from pellucid._errors import IdentificationError
from pellucid.emg.estimators.raw_session import RAW_LIMITS, RawChannels

MUSCLES = ("vastus", "hamstring", "soleus")


def worn(seed, seconds=8.0):
    """Three muscles that work in turn [V]."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / FS)
    return {
        muscle: raw_emg(2e-4 * (0.05 + np.maximum(np.sin(2.0 * np.pi * (0.4 * time + phase)), 0.0) ** 2), rng)
        for muscle, phase in zip(MUSCLES, (0.0, 0.35, 0.7), strict=True)
    }


@pytest.fixture(scope="module")
def fitted():
    return RawChannels.from_recordings([(worn(0), FS), (worn(1), FS)])


def kinds(fitted, channels):
    return {(c.muscle, c.kind, c.other) for c in fitted.changes(RawChannels.from_recordings([(channels, FS)]))}


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_the_same_electrodes_another_time(fitted, seed):
    assert kinds(fitted, worn(seed)) == set()
    louder = {muscle: 3.0 * x for muscle, x in worn(seed).items()}
    assert kinds(fitted, louder) == set()


def test_what_becomes_of_an_electrode_is_named(fitted):
    made = worn(2)
    x, time = made["vastus"], np.arange(len(made["vastus"])) / FS
    dry = signal.sosfilt(signal.butter(2, 45.0, fs=FS, output="sos"), x)
    assert kinds(fitted, {**made, "vastus": dry}) == {("vastus", "spectrum", "")}
    hum = x + 1.2 * np.std(x) * np.sin(2.0 * np.pi * 50.0 * time)
    assert kinds(fitted, {**made, "vastus": hum}) == {("vastus", "hum", "")}
    most = np.quantile(np.abs(x), 0.97)
    assert ("vastus", "saturation", "") in kinds(fitted, {**made, "vastus": np.clip(x, -most, most)})


def test_two_electrodes_that_hear_one_muscle_are_both_named(fitted):
    made = worn(2)
    both = kinds(fitted, {**made, "soleus": made["soleus"] + 1.5 * made["vastus"]})
    assert both == {("soleus", "shared", "vastus"), ("vastus", "shared", "soleus")}


def test_a_muscle_that_does_nothing_has_no_spectrum_to_compare(fitted):
    rng, made = np.random.default_rng(9), worn(2)
    noise = signal.sosfilt(signal.butter(2, 45.0, fs=FS, output="sos"), rng.standard_normal(len(made["soleus"])))
    assert kinds(fitted, {**made, "soleus": 1e-6 * noise}) == set()


def test_what_cannot_be_compared_is_refused(fitted):
    with pytest.raises(IdentificationError, match=f"of raw EMG, expected at least {RAW_LIMITS.min_recording_s:g} s"):
        RawChannels.from_recordings([(worn(2, seconds=1.0), FS)])
    with pytest.raises(IdentificationError, match="expected the same in each"):
        RawChannels.from_recordings([(worn(2), FS), ({"vastus": worn(2)["vastus"]}, FS)])
