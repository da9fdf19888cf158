"""Isometric tests as laboratories record them: raw EMG, a joint held by a dynamometer, %MVC, maximal contractions."""

import numpy as np
import pytest
from made_emg import FS, raw_emg

import pellucid
from pellucid._errors import IdentificationError, RecordingError, StudyError
from pellucid.emg.study.emg_torque.emg_torque_table import EmgTorqueTable
from pellucid.emg.study.emg_torque.relative_envelopes import emg_faults, find_scales, scale_rows, scale_verdicts
from pellucid.emg.study.emg_torque.study_muscles import ignored_channel_verdicts
from pellucid.emg.study.emg_torque.trial_sources import moment_trials
from pellucid.emg.study.muscle_channels import find_notch, mains_verdicts, notch_frequencies, study_chain
from pellucid.models.parameter_card import read_parameter_card
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check
from pellucid.study.quality import cut_faults, left_out_fault

STUDY = """
name = "isometric"

[rig]
joint = "knee"
motion = "rotary"
lifts = "extension"

[channels]
time = { rate = "2048 Hz" }
emg.vastus_lateralis = { column = "VL", unit = "mV" }
emg.biceps_femoris = { column = "BF", unit = "mV" }
angle.knee = { value = "-60 deg" }
moment.knee = { column = "torque", unit = "%MVC" }

[emg_torque]
joints = ["knee"]
chain = "hill"
"""
RECORDINGS = """
[[recordings]]
name = "mvc"
file = "mvc.csv"
protocol = "mvc"

[[recordings]]
name = "ramps"
file = "ramps.csv"

[[recordings]]
name = "others"
file = "others.csv"
use = "validate"
channels.angle.knee = { value = "-90 deg" }
"""


def contraction(effort, rng):
    """Raw EMG [mV] and torque [%MVC] of an effort (n,)."""
    vastus, biceps = (1e3 * raw_emg(gain * (0.01 + x), rng) for gain, x in ((4e-4, effort), (2e-4, 0.2 * effort)))
    return np.column_stack([vastus, biceps, 100.0 * effort])


def ramp(seconds, tops, rng):
    time = np.arange(0.0, seconds, 1.0 / FS)
    return contraction(np.interp(time, np.linspace(0.0, seconds, len(tops)), tops), rng)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("isometric"), np.random.default_rng(5)
    made = {
        "mvc": ramp(4.0, (0, 1, 1, 0), rng),
        "ramps": ramp(12.0, (0, 0.6, 0.1, 0.8, 0), rng),
        "others": ramp(8.0, (0, 0.4, 0.7, 0), rng),
    }
    for name, table in made.items():
        np.savetxt(folder / f"{name}.csv", table, fmt="%.5f", delimiter=",", header="VL,BF,torque", comments="")
    return folder


def study(files, text=STUDY, recordings=RECORDINGS):
    (files / "study.toml").write_text(text + recordings, encoding="utf-8")
    return open_study(files)


def test_a_constant_angle_and_shares_of_a_maximal_contraction(files):
    made = study(files)
    assert [f.message for f in check(made) if f.severity == "refuse"] == []
    ramps, others = moment_trials(made, "knee")
    assert (ramps.unit, others.heldout) == ("MVC", True)
    assert ramps.fs == pytest.approx(102.4, rel=0.01)
    assert np.ptp(ramps.angles["knee"]) == 0.0
    assert ramps.angles["knee"][0] == pytest.approx(np.radians(-60.0))
    assert others.angles["knee"][0] == pytest.approx(np.radians(-90.0))
    assert np.max(ramps.torque) == pytest.approx(0.8, rel=0.02)
    # Relative to the maximal contraction, which is fitted nowhere.
    assert np.max(ramps.envelopes["vastus_lateralis"]) == pytest.approx(0.8, abs=0.2)


def test_scales_have_an_interval_in_rows_and_notes(files):
    scales = find_scales(study(files))
    assert [scale.muscle for scale in scales] == ["vastus_lateralis", "biceps_femoris"]
    assert all(scale.low < scale.value < scale.high < 2.0 * scale.value for scale in scales)
    rows = {row.id: row.value for row in scale_rows("isometric", scales)}
    assert rows["isometric.emg_scale.vastus_lateralis.low"] == pytest.approx(scales[0].low)
    (note,) = scale_verdicts(scales)
    assert "95 % interval" in note.text


@pytest.mark.parametrize(
    ("asked", "top"), [('normalise = "largest"', 1.0), ('normalise = "none"', 4e-4), ('normalise = "mvc"', 0.8)]
)
def test_a_normalisation_that_is_asked_for(files, asked, top):
    ramps, _ = moment_trials(study(files, f"{STUDY}{asked}\n"), "knee")
    assert 0.6 * top < np.max(ramps.envelopes["vastus_lateralis"]) < 1.3 * top


def test_a_normalisation_of_a_chain_that_has_none_needs_its_recording(files):
    text = STUDY.replace('chain = "hill"', 'chain = "knee"\nnormalise = "mvc"')
    ramps, _ = moment_trials(study(files, text), "knee")
    assert 0.5 < np.max(ramps.envelopes["vastus_lateralis"]) < 1.1
    without = study(files, text, RECORDINGS.replace('protocol = "mvc"', 'protocol = "rest"'))
    with pytest.raises(IdentificationError, match='found no recording with the protocol "mvc"'):
        moment_trials(without, "knee")


def test_a_largest_moment_gives_muscles_their_newtons(files):
    made = study(files, f'{STUDY}\n[emg_torque.largest_moment]\nknee = "200 N*m"\n')
    ramps, _ = moment_trials(made, "knee")
    assert ramps.unit == "N*m"
    assert np.max(ramps.torque) == pytest.approx(160.0, rel=0.02)


def test_units_that_do_not_agree_and_constants_that_are_none_are_refused(files):
    both = RECORDINGS + '\nchannels.moment.knee = { column = "torque", unit = "N*m" }\n'
    both = both.replace('channels.angle.knee = { value = "-90 deg" }\n\nchannels', "channels")
    with pytest.raises(RecordingError, match="found the unit N\\*m, expected MVC as in the recording ramps"):
        moment_trials(study(files, recordings=both), "knee")
    with pytest.raises(StudyError, match='expected a number and its unit, such as "60 deg"'):
        study(files, STUDY.replace('"-60 deg"', '"bent"'))
    with pytest.raises(StudyError, match="found value and unit, expected value alone"):
        study(files, STUDY.replace('{ value = "-60 deg" }', '{ value = "-60 deg", unit = "deg" }'))
    with pytest.raises(StudyError, match='found the unit "%MVC", expected "rad"'):
        study(files, STUDY.replace('"-60 deg"', '"-60 %MVC"'))


def test_an_electrode_that_came_loose_is_named_by_check(files):
    table = np.loadtxt(files / "others.csv", delimiter=",", skiprows=1)
    table[:, 0] += 1.5 * np.std(table[:, 0]) * np.sin(2.0 * np.pi * 50.0 * np.arange(len(table)) / FS)
    np.savetxt(files / "loose.csv", table, fmt="%.5f", delimiter=",", header="VL,BF,torque", comments="")
    named = check(study(files, recordings=RECORDINGS.replace("others.csv", "loose.csv")))
    told = [f for f in named if f.kind == "changed_channel"]
    assert {f.channel for f in told} == {"emg.vastus_lateralis"}
    assert any("% of the power at the mains' frequencies, expected about" in f.message for f in told)


@pytest.mark.slow
@pytest.mark.slow
def test_what_is_calibrated_says_its_unit_and_what_envelopes_are_relative_to(files):
    made = study(files)
    found = pellucid.calibrate(made)
    assert "MVC" in found.headline
    said = "relative to each muscle's largest value in maximal contractions: mvc"
    assert any(said in v.text for v in found.verdicts)
    assert any("in shares of a maximal contraction" in v.text for v in found.verdicts)
    ridge = next(r for r in found.rows if r.id == "isometric.knee.ridge.rmse")
    assert ridge.unit == "MVC"
    assert ridge.value < 0.2
    found.save(made)
    card = read_parameter_card(made.models_dir / "torque_map_knee.json")
    assert {p.unit for p in card.parameters if p.name == "offset"} == {"MVC"}
    assert "Error (MVC)" in pellucid.report(made, found).read_text(encoding="utf-8")
    # Another angle than the one that was held.
    assert "No estimate is valid on others" in found.headline
    # Where no estimate is valid, no band is stated or drawn.
    assert all(not trace.half_width for trace in found.traces if trace.recording == "others")
    (named,) = (t for t in found.tables if t.title == "Recommended estimators")
    assert [r[-1] for r in named.rows if r[0] == "knee, others"] == ["none stated"]


# --- files as laboratories have them ----------------------------------------------------------------------------------


def write_table(folder, name, table, head="VL,BF,torque"):
    np.savetxt(folder / f"{name}.csv", table, fmt="%.5f", delimiter=",", header=head, comments="")


@pytest.fixture
def own_files(files, tmp_path):
    for path in files.glob("*.csv"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def read_table(folder, name):
    return np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1)


def test_the_file_of_a_maximal_contraction_needs_emg_only(own_files):
    before = [t.envelopes for t in moment_trials(study(own_files), "knee")]
    write_table(own_files, "mvc", read_table(own_files, "mvc")[:, :2], "VL,BF")
    made = study(own_files)
    assert [f.message for f in emg_faults(made) if f.severity == "refuse"] == []
    for old, new in zip(before, moment_trials(made, "knee"), strict=True):
        assert all(np.array_equal(old[m], new.envelopes[m]) for m in old)
    # Any other recording still needs what it is compared with.
    write_table(own_files, "ramps", read_table(own_files, "ramps")[:, :2], "VL,BF")
    with pytest.raises(RecordingError, match=r'ramps\.csv: channel moment\.knee expects a column "torque"'):
        moment_trials(study(own_files), "knee")


STREAMED = STUDY.replace('time = { rate = "2048 Hz" }\n', 'time = { rate = "100 Hz" }\n', 1).replace(
    'emg.vastus_lateralis = { column = "VL", unit = "mV" }\nemg.biceps_femoris = { column = "BF", unit = "mV" }\n', ""
) + (
    '\n[streams.emg.channels]\ntime = { rate = "2048 Hz" }\n'
    'emg.vastus_lateralis = { column = "VL", unit = "mV" }\nemg.biceps_femoris = { column = "BF", unit = "mV" }\n'
)
STREAMED_RECORDINGS = """
[[recordings]]
name = "mvc"
protocol = "mvc"
streams.emg = "mvc.csv"

[[recordings]]
name = "ramps"
file = "torque.csv"
streams.emg = "ramps.csv"
"""


@pytest.fixture
def streamed(own_files):
    torque = read_table(own_files, "ramps")[:, 2]
    time = np.arange(0.0, 12.0, 0.01)
    slow = np.interp(time, np.arange(len(torque)) / FS, torque)
    write_table(own_files, "torque", slow[:, None], "torque")
    for name in ("mvc", "ramps"):
        write_table(own_files, name, read_table(own_files, name)[:, :2], "VL,BF")
    return own_files


def test_a_maximal_contraction_may_be_a_stream_alone(streamed):
    made = study(streamed, STREAMED, STREAMED_RECORDINGS)
    assert [f.message for f in check(made) if f.severity == "refuse"] == []
    (ramps,) = moment_trials(made, "knee")
    assert np.max(ramps.envelopes["vastus_lateralis"]) == pytest.approx(0.8, abs=0.2)
    assert made.recording("mvc").path.name == "mvc.csv"
    with pytest.raises(StudyError, match="expected one of file and files, found neither"):
        study(streamed, STREAMED, STREAMED_RECORDINGS.replace('protocol = "mvc"\n', ""))


@pytest.mark.parametrize("column", [0, 2])
def test_an_end_without_samples_is_trimmed(own_files, column):
    whole = read_table(own_files, "others")
    table = whole.copy()
    table[-3000:, column] = np.nan
    table[:1000, column] = np.nan
    write_table(own_files, "others", table)
    made = study(own_files)
    told = [f.message for f in cut_faults(made.recording("others"))]
    channel = "emg.vastus_lateralis" if column == 0 else "moment.knee"
    assert len(told) == 2
    assert f"found no samples (NaN) of {channel} in the first 1000 of 16384 rows at 0 s (before sample 0)" in told[0]
    assert f"found no samples (NaN) of {channel} in the last 3000 of 16384 rows" in told[1]
    trial = moment_trials(made, "knee")[-1]
    assert (trial.time[0], trial.time[-1]) == pytest.approx((1000 / FS, 13384 / FS), abs=0.02)
    assert np.isfinite(trial.torque).all()


def test_a_stream_that_ends_early_ends_its_recording(streamed):
    table = read_table(streamed, "ramps")
    table[-4000:, 1] = np.nan
    write_table(streamed, "ramps", table, "VL,BF")
    made = study(streamed, STREAMED, STREAMED_RECORDINGS)
    faults = check(made)
    assert [f.message for f in faults if f.severity == "refuse"] == []
    assert any("nothing of the stream emg, which was trimmed in the last" in f.message for f in faults)
    (ramps,) = moment_trials(made, "knee")
    assert ramps.time[-1] == pytest.approx((len(table) - 4000) / FS, abs=0.02)


def test_a_gap_within_a_recording_or_half_of_it_still_leaves_it_out(own_files):
    for rows in (slice(8000, 8100), slice(8000, None)):
        table = read_table(own_files, "others")
        table[rows, 0] = np.nan
        write_table(own_files, "others", table)
        made = study(own_files)
        assert "the recording is excluded" in left_out_fault(made.recording("others"), made, whole=True).message
        table[rows, 0] = 0.1
        write_table(own_files, "others", table)


@pytest.mark.nightly
def test_both_sides_of_a_gap_are_fitted(own_files):
    table = read_table(own_files, "ramps")
    table[8000:8100, 0] = np.nan
    write_table(own_files, "ramps", table)
    assert pellucid.calibrate(study(own_files)).evaluated


def test_nothing_left_to_fit_is_said(own_files):
    table = read_table(own_files, "ramps")
    for gap in range(0, len(table), 600):
        table[gap : gap + 100, 0] = np.nan
    write_table(own_files, "ramps", table)
    with pytest.raises(IdentificationError, match="found 0 recordings to fit and 1 held out"):
        pellucid.calibrate(study(own_files))
    check(study(own_files))


@pytest.mark.parametrize("recording", ["ramps", "others"])
def test_an_extra_channel_is_ignored_with_a_note(files, recording):
    entry = 'channels.emg.extra = { column = "BF", unit = "mV" }'
    file = f'file = "{recording}.csv"'
    made = study(files, recordings=RECORDINGS.replace(file, f"{file}\n{entry}"))
    assert [f.kind for f in emg_faults(made) if f.channel == "emg.extra"] == ["extra_channel"]
    assert all(list(t.envelopes) == ["vastus_lateralis", "biceps_femoris"] for t in moment_trials(made, "knee"))
    (verdict,) = ignored_channel_verdicts(made)
    assert verdict.text.startswith(f"{recording}: emg.extra is not used, because ")
    # Only a channel that a fitted recording has is lost to the calibration.
    assert verdict.kind == ("warning" if made.recording(recording).use == "fit" else "note")


def test_a_recording_that_lacks_a_muscle_is_refused(files):
    everywhere = STUDY.replace('emg.biceps_femoris = { column = "BF", unit = "mV" }\n', "")
    extra = 'channels.emg.biceps_femoris = { column = "BF", unit = "mV" }'
    recordings = RECORDINGS.replace('file = "mvc.csv"', f'file = "mvc.csv"\n{extra}')
    recordings = recordings.replace('file = "ramps.csv"', f'file = "ramps.csv"\n{extra}')
    with pytest.raises(RecordingError, match=r"others.*found EMG of vastus_lateralis, expected biceps_femoris"):
        moment_trials(study(files, everywhere, recordings), "knee")


@pytest.mark.parametrize("mains", [None, 60.0])
def test_mains_are_found_in_fitted_recordings_if_the_study_asks(own_files, mains):
    hum = 0.5 * np.sin(2.0 * np.pi * 60.0 * np.arange(24576) / FS)
    if mains:
        table = read_table(own_files, "ramps")
        write_table(own_files, "ramps", table + np.column_stack([hum, hum, 0.0 * hum])[: len(table)])
    else:  # A recording to be judged decides nothing.
        table = read_table(own_files, "others")
        write_table(own_files, "others", table + np.column_stack([hum, hum, 0.0 * hum])[: len(table)])
    made = study(own_files, STUDY.replace('chain = "hill"', 'chain = "hill"\nmains = "auto"'))
    asked = made.table(EmgTorqueTable)
    assert find_notch(made, asked) == mains
    assert notch_frequencies(study_chain(made, asked)) == (mains or 50.0,)
    (note,) = mains_verdicts(made, asked)
    assert ("have mains hum at 60 Hz" if mains else "have no mains hum") in note.text
    with pytest.raises(StudyError, match="mains"):
        study(own_files, STUDY.replace('chain = "hill"', 'chain = "hill"\nmains = "found"'))
