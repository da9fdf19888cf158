"""Files of a worn orthosis that are not as they should be: `check` and `calibrate` name file, channel, found, expected.

A strap that slips in mid-trial shows only in a fit: tests/unit/test_identify_coupling.py.
"""

import csv

import numpy as np
import pytest

import pellucid
from pellucid._errors import RecordingError
from pellucid.emg.estimators.torque_trial import MovedBody
from pellucid.emg.study.emg_torque.trial_sources import step_trials
from pellucid.study.procedures.registry import open_study
from pellucid_lab.knee.protocol import Faults, mvc_trial, relaxed_trial, swing_trial, torque_trial
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.study import write_study

RIG = knee_orthosis()
S1 = RIG.subjects["S1"]


def steps(name, **faults):
    return torque_trial(RIG, name, S1, float(np.radians(30.0)), faults=Faults(**faults))


def swing(name, **faults):
    return swing_trial(RIG, name, S1, duration=12.0, faults=Faults(**faults))


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    made = [mvc_trial(RIG, "S1_mvc", S1), relaxed_trial(RIG, "S1_relaxed_1", S1), steps("S1_torque_30_1")]
    return write_study(tmp_path_factory.mktemp("sound"), RIG, name="sound", seed=3, trials=[*made, swing("S1_swing")])


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory):
    """Each recording with one thing wrong, but for the maximal contraction."""
    made = [
        mvc_trial(RIG, "S1_mvc", S1),
        relaxed_trial(RIG, "S1_relaxed_1", S1, helps=True),
        steps("S1_torque_slow_1", emg_rate=900.0),
        steps("S1_torque_late_1"),
        steps("S1_torque_long_1"),
        steps("S1_torque_open_1", emg_detached={1: 0.0}),
        steps("S1_torque_small_1", emg_clipped={1: 2e-5}),
        steps("S1_torque_swapped_1"),
        swing("S1_swing_silent", imu_dropout=(4.0, 2.0)),
        swing("S1_swing_turned", encoder_turn=2.9),
    ]
    study = write_study(tmp_path_factory.mktemp("spoilt"), RIG, name="spoilt", seed=3, trials=made)
    for name, change in (
        ("S1_torque_late_1", lambda rows: [[i // 2, *row[1:]] for i, row in enumerate(rows) if i % 2 == 0]),
        ("S1_torque_long_1", lambda rows: [[2 * int(row[0]), *row[1:]] for row in rows]),
        ("S1_torque_swapped_1", lambda rows: [[row[0], row[2], row[1]] for row in rows]),
    ):
        path = study.folder / "recordings" / f"{name}_emg.csv"
        head, *rows = csv.reader(path.read_text().splitlines())
        path.write_text("\n".join(",".join(map(str, row)) for row in [head, *change(rows)]) + "\n")
    return open_study(study.folder)


@pytest.fixture(scope="module")
def faults(spoilt):
    return pellucid.check(spoilt)


def test_sound_files_are_fit(sound):
    assert [fault.message for fault in pellucid.check(sound) if fault.severity == "refuse"] == []


@pytest.mark.parametrize(
    ("file", "severity", "kind", "channel", "found", "expected"),
    [
        ("S1_relaxed_1", "refuse", "not_relaxed", "emg.lateral_hamstring", "of a maximal", "should be relaxed"),
        ("S1_torque_slow_1_emg", "note", "rate", "time", "900 Hz", "2048 Hz as in the study's other files"),
        ("S1_torque_late_1_emg", "refuse", "rate", "time", "s of EMG at 2048 Hz", "as long at 1024 Hz"),
        ("S1_torque_long_1_emg", "note", "rate", "time", "s of EMG at 1024 Hz", "as long at 2048 Hz"),
        ("S1_torque_open_1_emg", "refuse", "detached_electrode", "emg.lateral_hamstring", "hum at 50 Hz", "detached"),
        ("S1_torque_small_1_emg", "refuse", "clipped", "emg.lateral_hamstring", "in runs", "range of the amplifier"),
        ("S1_torque_swapped_1_emg", "refuse", "swapped_channels", "emg.lateral_hamstring", "with", "changed"),
        ("S1_swing_silent", "refuse", "gap", "imu.angular_velocity", "no sample from", "shorter than 2 s"),
        ("S1_swing_turned", "note", "wrap", "position", "", ""),
    ],
)
def test_what_is_wrong_is_told(faults, file, severity, kind, channel, found, expected):
    (fault,) = (f for f in faults if f.file == f"{file}.csv" and f.kind == kind)
    assert fault.severity == severity
    for part in (file, channel, found, expected):
        assert part in fault.message, fault.message


def test_nothing_else_is_refused(faults):
    assert len([fault for fault in faults if fault.severity == "refuse"]) == 6
    assert not [fault for fault in faults if "mvc" in fault.file]


def test_calibration_refuses_them_too(spoilt):
    lacking = (
        r"S1_torque_late_1_emg.csv .*, channel emg.rectus_femoris: found samples from 0 s to 15 s, expected 0 s to 30"
    )
    with pytest.raises(RecordingError, match=lacking):
        step_trials(spoilt, "S1", MovedBody(8.0))
