"""Whatever a procedure makes of a recording, what is cut out of it takes no part."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.emg.study.emg_torque.trial_sources import moment_trials
from pellucid.emg.study.isolated_muscle.isolated_muscle import isolated_muscle
from pellucid.files.cut import Cut
from pellucid.files.recording import Channel, Recording
from pellucid.joint.slider.study.recorded_slider import slider_motions
from pellucid.orthosis.imu.imu_angle import inertial
from pellucid.orthosis.input_output import input_output
from pellucid.orthosis.study.loaded_swing.identify_loaded_swing import swings_of
from pellucid.orthosis.swing.loaded_swing import corrected_form, fit_swings
from pellucid.people.study.pointing import pointing_record
from pellucid.study.datasets import init
from pellucid.study.procedures.registry import asked
from pellucid.study.procedures.run import check, identify

SPIKE, NAN = (slice(900, 901), 50.0), (slice(900, 940), np.nan)
TORQUE = ('kind = "current"\ntorque_constant = "2 N*m/A"', 'kind = "torque"')
CHANNEL = ('current = { column = "i", unit = "A" }', 'torque = { column = "i", unit = "N*m" }')


def spoilt(make_study, where, value, *changes, append="", column="q"):
    columns = make_study.swing()
    columns[column] = columns[column].copy()
    columns[column][where] = value
    return make_study(columns, *changes, append=append)


def with_cut(study, name, channel, first, last):
    """A recording of a study, from now on with a cut in which one channel is nonsense."""
    recording = study.recording(name)
    samples = recording[channel].copy()
    samples[first : last + 1] = 1e6
    cut = Cut("spike", channel, float(recording.time[first]), float(recording.time[last + 1]), first, last, "a spike")
    channels = {**recording.channels, channel: replace(recording.channels[channel], samples=samples)}
    study.kept.recordings[name] = replace(recording, channels=channels, cuts=(cut,))
    return study


LINEAR = '\n[transfer_function]\ninput = "torque"\noutput = "position"\npoles = 2\n'


@pytest.mark.parametrize(("where", "value"), [SPIKE, (slice(900, 903), np.nan)])
def test_a_transfer_function(make_study, where, value):
    clean = identify(make_study(None, TORQUE, CHANNEL, append=LINEAR))
    study = spoilt(make_study, where, value, TORQUE, CHANNEL, append=LINEAR)
    found = identify(study)
    assert found["stiffness"].value == pytest.approx(clean["stiffness"].value, rel=0.02)
    assert any("excluded" in v.text or "cut out" in v.text for v in found.verdicts)


def test_a_lost_stretch_of_input_ends_a_record(make_study):
    study = spoilt(make_study, slice(900, 1000), np.nan, TORQUE, CHANNEL, append=LINEAR)
    record = input_output(study.recording("sweep"), ("torque", "position"))
    assert (len(record), record.time[0]) == (1000, 5.0)
    kept = "only the longest stretch without them, 1000 samples, is kept"
    assert f"100 consecutive samples are missing; {kept}" in record.notes


SWINGS = '\n[loaded_swing]\nlowpass = "10 Hz"\n'


@pytest.mark.parametrize(("where", "value"), [SPIKE, NAN])
def test_a_loaded_swing(make_study, where, value):
    def bodies(study):
        return fit_swings(swings_of(study.recording("sweep"), 10.0), corrected_form(0.0))

    clean = bodies(make_study(None, TORQUE, CHANNEL, append=SWINGS))
    study = spoilt(make_study, where, value, TORQUE, CHANNEL, append=SWINGS)
    assert len(swings_of(study.recording("sweep"), 10.0)) == 2
    found = bodies(study)
    assert found.inertia.value == pytest.approx(clean.inertia.value, rel=0.02)
    assert found.weight_moment.value == pytest.approx(clean.weight_moment.value, rel=0.02)


@pytest.mark.parametrize(("where", "value"), [SPIKE, NAN])
def test_a_joint_with_a_carriage(make_study, where, value):
    def motion(study):
        geometry = SimpleNamespace(placements=[SimpleNamespace(recording="sweep", slider=0.1)])
        (made,) = slider_motions([study.recording("sweep")], study.config, geometry)
        return made

    clean, found = motion(make_study()), motion(spoilt(make_study, where, value))
    assert np.isfinite(found.position).all()
    assert np.abs(found.acceleration[found.scored]).max() < 1.5 * np.abs(clean.acceleration[clean.scored]).max()


def test_an_imu(rng):
    time = np.arange(500) / 100.0
    names = [f"imu.{what}.{axis}" for what in ("angular_velocity", "acceleration") for axis in "xyz"]
    values = {name: np.sin(time + i) + 1e-3 * rng.standard_normal(500) for i, name in enumerate(names)}
    values[names[0]][200:203] = 900.0
    channels = {"time": Channel("time", time, "s", "t"), **{n: Channel(n, x, "1", n) for n, x in values.items()}}
    cut = Cut("spike", names[0], 2.0, 2.03, 200, 202, "a spike")
    made = inertial(Recording("r", SimpleNamespace(name="r.csv"), "", "fit", channels, cuts=(cut,)))
    assert np.abs(made.angular_velocity).max() < 1.1
    assert made.interpolated == 3


@pytest.mark.parametrize(("where", "value"), [SPIKE, NAN])
def test_an_assessment(make_study, where, value):
    asked = '\n[assessment]\ncontrol = "FC"\n'
    person = ('protocol = "multisine"', 'participant = "P"\ncondition = "FC"')
    people = ("[processing]", "[participants.P]\n[processing]")

    def travel(study):
        record = pointing_record(study.recording("sweep"), study.config.assessment)
        return np.ptp(record.motion(SimpleNamespace(lowpass=3.0, order=4)).angle)

    clean = travel(make_study(None, person, people, append=asked))
    assert travel(spoilt(make_study, where, value, person, people, append=asked)) == pytest.approx(clean, rel=0.02)


def test_an_isolated_muscle(data_folder, tmp_path):
    study = init(tmp_path / "rat", dataset="rat_soleus_hill")
    clean = isolated_muscle(study).mae_percent
    name = study.recordings()[0].name
    spoilt = with_cut(study, name, "force", 40, 41)
    assert isolated_muscle(spoilt).mae_percent == pytest.approx(clean, rel=0.02)
    stream = spoilt.recording(name).streams["displacement"]
    lost = replace(stream, cuts=(Cut("spike", "displacement", 0.0, 0.1, 3, 3, "a spike of 3 mm"),))
    study.kept.recordings[name] = replace(spoilt.recording(name), streams={"displacement": lost})
    with pytest.raises(RecordingError, match=r"found a spike of 3 mm .* expected a displacement without gaps"):
        isolated_muscle(study)


def test_torque_from_emg_uses_both_sides_of_a_cut(data_folder, tmp_path):
    study = init(tmp_path / "walking", dataset="lower_limb_walking")
    names = [recording.name for recording in study.recordings()]
    study = with_cut(study, names[0], "angle.knee", 200, 202)
    taken = asked(study, "emg_torque")[0].taken(study)
    assert [r.name for r in taken.recordings()] == [f"{names[0]}.1", f"{names[0]}.2", *names[1:]]
    trials = moment_trials(taken, "knee")
    assert [t.recording for t in trials] == [names[0], names[0], *names[1:]]
    assert len({t.group for t in trials}) == len(names)
    assert max(np.abs(t.angles["knee"]).max() for t in trials) < 10.0  # the nonsense between them is in none
    assert not [fault for fault in check(study) if fault.kind == "left_out"]


def test_torque_from_emg_leaves_a_recording_out_of_which_too_little_is_left(data_folder, tmp_path):
    study = init(tmp_path / "walking", dataset="lower_limb_walking")
    recording = study.recordings()[0]
    every = [Cut("gap", "time", t, t, i, i - 1, "a gap") for i, t in enumerate(recording.time) if i % 20 == 10]
    study.kept.recordings[recording.name] = replace(recording, cuts=tuple(every))
    with_others = [r.name for r in study.recordings()[1:]]
    assert [r.name for r in asked(study, "emg_torque")[0].taken(study).recordings()] == with_others
    (told,) = [fault for fault in check(study) if fault.kind == "left_out"]
    assert told.severity == "warn"
    assert told.message.endswith("expected 1 s of samples without a break: the recording is excluded")
