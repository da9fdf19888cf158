"""Windows of a recording have the envelopes and the onsets that the whole recording has there."""

import numpy as np
import pytest
from made_emg import FS, raw_emg

from pellucid._errors import RecordingError
from pellucid.emg.study.emg_torque.study_faults import trial_refusals
from pellucid.emg.study.emg_torque.torque_findings import CalibrationFindings, find_applicable_estimators
from pellucid.emg.study.emg_torque.trial_sources import moment_trials
from pellucid.emg.study.muscle_channels import relative_envelopes
from pellucid.emg.study.onset.find_onsets import find_onsets
from pellucid.people.emg_index import Activity
from pellucid.people.study.assessment_table import AssessmentTable
from pellucid.people.study.pointing import rectified_emg
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check

SECONDS = 14.0
STUDY = """
name = "windows"

[rig]
joint = "knee"
motion = "rotary"
lifts = "extension"

[emg_torque]
joints = ["knee"]
chain = "hill"
normalise = "none"

[cocontraction]
chain = "hill"
pairs = [["vastus_lateralis", "biceps_femoris_long"]]

[onset]
"""
EMG = """emg.vastus_lateralis = { column = "VL", unit = "V" }
emg.biceps_femoris_long = { column = "BF", unit = "V" }
"""
MOTION = """time = { column = "time", unit = "s" }
angle.knee = { column = "angle", unit = "rad" }
moment.knee = { column = "moment", unit = "N*m" }
"""
WINDOWS = {"whole": None, "fitted": (2.0, 7.0), "judged": (7.0, 11.5)}


def recordings(streams=""):
    """Entries of the recordings, each a window of the same file."""
    text = ""
    for name, window in WINDOWS.items():
        text += f'\n[[recordings]]\nname = "{name}"\nfile = "leg.csv"\n{streams}'
        text += 'use = "validate"\n' if name == "judged" else ""
        text += "" if window is None else f'window = ["{window[0]:g} s", "{window[1]:g} s"]\n'
    return text


@pytest.fixture(scope="module", params=["one file", "a stream"])
def study(request, tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("windows"), np.random.default_rng(4)
    t = np.arange(0.0, SECONDS, 1.0 / FS)
    # Activity that is switched on and off, also where windows begin and end.
    on = [((t + shift) % 1.3 < 0.6).astype(float) for shift in (0.0, 0.7)]
    emg = np.column_stack([raw_emg(1e-4 * (0.01 + x), rng) for x in on])
    motion = np.column_stack([t, -0.5 + 0.3 * np.sin(2.0 * t), 20.0 * np.cos(2.0 * t)])
    if request.param == "one file":
        np.savetxt(folder / "leg.csv", np.column_stack([motion, emg]), delimiter=",", comments="", fmt="%.8g",
                   header="time,angle,moment,VL,BF")  # fmt: skip
        text = f"[channels]\n{MOTION}{EMG}" + recordings()
    else:
        np.savetxt(folder / "leg.csv", motion, delimiter=",", comments="", fmt="%.8g", header="time,angle,moment")
        np.savetxt(folder / "emg.csv", np.column_stack([t, emg]), delimiter=",", comments="", fmt="%.8g",
                   header="time,VL,BF")  # fmt: skip
        text = f'[channels]\n{MOTION}\n[streams.emg.channels]\ntime = {{ column = "time", unit = "s" }}\n{EMG}'
        text += recordings('streams = { emg = "emg.csv" }\n')
    (folder / "study.toml").write_text(f"{STUDY}\n{text}", encoding="utf-8")
    return open_study(folder)


@pytest.mark.parametrize("causal", [False, True])
def test_trials_of_windows_have_the_envelopes_of_the_whole(study, causal):
    whole, *parts = moment_trials(study, "knee", causal=causal)
    for part in parts:
        for muscle, x in part.envelopes.items():
            expected = np.interp(part.time, whole.time, whole.envelopes[muscle])
            assert x.min() >= 0.0
            # Thinning sees the window alone, which costs a little at its ends.
            assert np.median(np.abs(x - expected)) < 1e-3 * np.max(whole.envelopes[muscle])
            ends = np.abs(x - expected)[[*range(25), *range(-25, 0)]]
            assert np.max(ends) < 0.02 * np.max(whole.envelopes[muscle])


def test_relative_envelopes_of_windows_are_those_of_the_whole(study):
    whole, *parts = relative_envelopes(study, study.config.cocontraction)
    for part in parts:
        assert part.time[0] == pytest.approx(WINDOWS[part.name][0], abs=0.02)
        assert part.time[-1] == pytest.approx(WINDOWS[part.name][1], abs=0.02)
        for muscle, x in part.envelopes.items():
            expected = np.interp(part.time, whole.time, whole.envelopes[muscle])
            assert x.min() >= 0.0
            assert np.max(np.abs(x - expected)) < 0.02


def test_onsets_in_windows_are_those_of_the_whole(study):
    found = {(each.recording, each.muscle): each.bursts for each in find_onsets(study).muscles}
    for (name, muscle), bursts in found.items():
        if WINDOWS[name] is None:
            continue
        within = [b.onset.time for b in bursts if b.seen]
        expected = [b.onset.time for b in found["whole", muscle]]
        assert within
        assert max(min(abs(t - e) for e in expected) for t in within) < 0.03


def test_activity_of_a_window_is_advanced_from_before_it(study):
    spec = AssessmentTable(control="x", angle="angle.knee", agonists=("vastus_lateralis",), advance="0.1 s")
    whole, fitted, judged = (
        Activity.of_rectified(r.stream_or_self(spec.emg).time, rectified_emg(r, spec)) for r in study.recordings()
    )
    for part, name in ((fitted, "fitted"), (judged, "judged")):
        at = np.arange(WINDOWS[name][0] + 0.1, WINDOWS[name][1] - 0.1, 0.01)
        pair = [a.envelope(("vastus_lateralis",), {"vastus_lateralis": 1e-4}, at, 0.1) for a in (part, whole)]
        assert np.nanmax(np.abs(pair[0] - pair[1])) < 0.02


def test_what_check_calls_fit_is_made_by_the_functions_that_calibrate_uses(study):
    assert trial_refusals(study) == []


def test_what_calibrate_refuses_check_refuses_in_the_same_words(tmp_path):
    t = np.arange(0.0, 8.0, 0.01)
    envelope = 0.3 * np.sin(3.0 * t)  # was never rectified
    np.savetxt(tmp_path / "leg.csv", np.column_stack([t, 0.3 * np.sin(2.0 * t), 20.0 * np.cos(2.0 * t), envelope]),
               delimiter=",", comments="", header="time,angle,moment,VL")  # fmt: skip
    text = STUDY.partition("[cocontraction]")[0].replace('"hill"', '"none"').replace('normalise = "none"', "")
    vastus = 'emg.vastus_lateralis = { column = "VL", unit = "1" }\n'
    entry = '[[recordings]]\nname = "leg"\nfile = "leg.csv"\n'
    (tmp_path / "study.toml").write_text(f"{text}[channels]\n{MOTION}{vastus}{entry}", encoding="utf-8")
    study = open_study(tmp_path)
    with pytest.raises(RecordingError, match="expected none below 0") as refused:
        find_applicable_estimators(moment_trials(study, "knee"), "knee", CalibrationFindings())
    assert [(f.severity, f.message) for f in check(study) if f.kind == "envelope"] == [("refuse", str(refused.value))]
