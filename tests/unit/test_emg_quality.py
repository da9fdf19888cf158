"""EMG that is not fit to be used, and EMG that is."""

from dataclasses import replace

import numpy as np
import pytest
from made_emg import FS, emg_recording, raw_emg

from pellucid.emg.signals.emg_chain import emg_chain
from pellucid.emg.signals.emg_quality import (
    contrast_faults,
    find_hum,
    inspect_emg,
    relaxed_faults,
    resting_level,
    swapped_faults,
)

RNG = np.random.default_rng(11)
TIME = np.arange(int(6 * FS)) / FS
WORK = (TIME > 2.0) & (TIME < 4.0)
SOUND = raw_emg(np.where(WORK, 1e-4, 3e-6), RNG)
HUM = np.sin(2 * np.pi * 50.0 * TIME)
KNEE = emg_chain("knee")


def kinds(recording):
    return [(fault.severity, fault.kind) for fault in inspect_emg(recording)]


def test_sound_emg_has_no_fault():
    assert inspect_emg(emg_recording(biceps=SOUND)) == []


@pytest.mark.parametrize(
    ("x", "found"),
    [
        (np.zeros_like(SOUND), [("refuse", "detached_electrode")]),
        (5e-8 * RNG.standard_normal(len(TIME)), [("refuse", "detached_electrode")]),
        (2e-4 * HUM + 3e-6 * RNG.standard_normal(len(TIME)), [("refuse", "detached_electrode")]),
        (SOUND + 7e-5 * HUM, [("note", "mains_hum")]),
        (np.clip(SOUND, -8e-5, 8e-5), [("refuse", "clipped")]),
        (np.where(np.arange(len(TIME)) == 77, np.nan, SOUND), [("refuse", "missing_samples")]),
    ],
)
def test_raw_faults_are_found(x, found):
    assert kinds(emg_recording(biceps=x)) == found


def test_a_fault_names_file_channel_found_and_expected():
    (fault,) = inspect_emg(emg_recording("bad", sound=SOUND, hamstring=np.clip(SOUND, -8e-5, 8e-5)))
    assert (fault.file, fault.channel) == ("bad.csv", "emg.hamstring")
    assert "runs at the largest value" in fault.found
    assert fault.message.startswith("bad.csv (recording bad), channel emg.hamstring: found ")


@pytest.mark.parametrize(
    ("top", "found"),
    [(1.0, []), (1.5, [("refuse", "normalisation")]), (0.01, [("note", "normalisation")])],
)
def test_relative_envelopes_stay_near_their_maximum(top, found):
    assert kinds(emg_recording(unit="1", fs=100.0, biceps=top * np.sin(np.linspace(0, np.pi, 500)) ** 2)) == found


def test_an_envelope_that_never_moves_is_no_muscle():
    assert kinds(emg_recording(unit="1", fs=100.0, biceps=np.full(500, 0.4))) == [("refuse", "detached_electrode")]


def test_work_that_does_not_stand_out_is_told():
    recording = emg_recording(biceps=SOUND)
    flat = raw_emg(np.where(WORK, 6e-6, 5e-6), np.random.default_rng(2))
    made = {"biceps": KNEE.zero_phase(SOUND, FS), "triceps": KNEE.zero_phase(flat, FS)}
    assert [(f.kind, f.channel) for f in contrast_faults(recording, made)] == [("low_contrast", "emg.triceps")]


def test_a_subject_who_is_not_relaxed_is_found():
    effort = KNEE.zero_phase(SOUND, FS)
    rest, top = {"biceps": resting_level([effort])}, {"biceps": float(effort.max())}
    rng = np.random.default_rng(4)
    for amplitude, found in ((3e-6, []), (2e-5, ["not_relaxed"])):
        trial = raw_emg(np.full(len(TIME), amplitude), rng)
        recording = emg_recording("relaxed", biceps=trial)
        faults = relaxed_faults(recording, {"biceps": KNEE.zero_phase(trial, FS)}, rest, top)
        assert [f.kind for f in faults] == found
        assert all(f.severity == "refuse" and "relaxed.csv" in f.message for f in faults)


def test_swapped_electrodes_are_found():
    torque = np.sin(2 * np.pi * 0.5 * TIME)
    pull, push = np.maximum(torque, 0.0), np.maximum(-torque, 0.0)
    recording = emg_recording(hamstring=SOUND, rectus=SOUND)
    right = {"hamstring": pull, "rectus": push}
    wrong = {"hamstring": push, "rectus": pull}
    assert swapped_faults(recording, "hamstring", "rectus", right, torque) == []
    assert [f.kind for f in swapped_faults(recording, "hamstring", "rectus", wrong, torque)] == ["swapped_channels"]


def humming(mains: float, rng: np.random.Generator) -> np.ndarray:
    """EMG with the mains and its third harmonic in more than half of its power [V]."""
    t = np.arange(len(SOUND)) / FS
    hum = np.sin(2.0 * np.pi * mains * t + 0.3) + 0.3 * np.sin(6.0 * np.pi * mains * t)
    return SOUND + 1.6 * SOUND.std() * hum + 1e-7 * rng.standard_normal(len(SOUND))


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_hum_is_found_at_either_frequency_of_the_mains_and_its_key_is_named(mains, rng):
    recording = emg_recording("hum", biceps=humming(mains, rng))
    (taken,) = inspect_emg(recording, notches=(mains,))
    assert "the notch of the filter chain removes it" in taken.message
    (fault,) = inspect_emg(recording, notches=(110.0 - mains,))
    assert (fault.severity, fault.kind) == ("note", "mains_hum")
    assert f"hum at {mains:g} Hz" in fault.found
    assert f'mains = "{mains:g} Hz"' in fault.message
    assert find_hum([recording]) == mains
    assert find_hum([emg_recording("sound", biceps=SOUND)]) is None


def test_the_key_that_removes_hum_from_a_short_piece_is_that_of_its_file(rng):
    whole = emg_recording("hum", biceps=humming(60.0, rng))
    piece = replace(emg_recording("hum", biceps=whole["emg.biceps"][: round(FS)]), uncut=whole)
    (fault,) = inspect_emg(piece, notches=())
    assert "hum at 60 Hz" in fault.found
    assert 'mains = "60 Hz"' in fault.message


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_the_notch_lies_where_the_mains_is(mains, rng):
    t = np.arange(len(SOUND)) / FS
    hum = 1e-4 * np.sin(2.0 * np.pi * mains * t)
    printed, own = emg_chain("hill"), emg_chain("hill", mains=mains)
    sound = own.zero_phase(SOUND, FS, maximum=1.0)
    assert np.median(np.abs(own.zero_phase(SOUND + hum, FS, maximum=1.0) - sound)) < 0.02 * sound.max()
    if mains != 50.0:
        assert np.median(np.abs(printed.zero_phase(SOUND + hum, FS, maximum=1.0) - sound)) > 0.1 * sound.max()
    else:
        assert own == printed
    knee = emg_chain("knee", mains=mains)
    assert np.median(np.abs(knee.zero_phase(SOUND + hum, FS) - knee.zero_phase(SOUND, FS))) < 0.02 * knee.zero_phase(
        SOUND, FS
    ).max()
