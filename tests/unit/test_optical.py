"""A motion capture's file beside the machine's: what study.toml says of it, how it is read, what is wrong with it."""

import numpy as np
import pytest

from pellucid._errors import RecordingError, StudyError
from pellucid.files import OpticalRecording
from pellucid.study.procedures.registry import open_study
from pellucid.study.quality import inspect, require_sound

RAIL = '[rig.slider]\nlow = "80 mm"\nhigh = "24 cm"\nmarker = "C"\n'
OPTICAL = '[optical]\ntime = { column = "time", unit = "s" }\nunit = "mm"\nmarkers = ["C", "R1"]\ndown = [0, 0, -2]\n'
SEEN = 'optical = "recordings/sweep_markers.csv"\n'
FS = 179.0


def frames(seconds=10.0):
    """Two markers on a forearm that swings as the robot's: name to coordinates [mm]."""
    time = np.arange(round(seconds * FS)) / FS
    q = 0.5 * np.sin(2 * np.pi * 0.4 * time)
    at = {"C": 150.0, "R1": 260.0}
    return time, {m: np.c_[np.full(len(q), 30.0), r * np.sin(q), 900 - r * np.cos(q)] for m, r in at.items()}


def text_of(time, markers, lost=""):
    names = [f"{marker}_{axis}" for marker in markers for axis in "xyz"]
    table = np.column_stack([time, *markers.values()])
    rows = (",".join(lost if np.isnan(v) else repr(v) for v in row) for row in table.tolist())
    return "\n".join([",".join(["time", *names]), *rows]) + "\n"


@pytest.fixture
def make_optical(make_study):
    """A study whose one recording has an optical file, of this text."""

    def make(text=None, *changes, columns=None, append=SEEN):
        first = ("[channels]", f"{RAIL}\n{OPTICAL}\n[channels]")
        study = make_study(columns, first, *changes, append=append)
        if text is not None:
            (study.folder / "recordings" / "sweep_markers.csv").write_text(text, encoding="utf-8")
        return open_study(study.folder)

    return make


def faults(study):
    return [f for f in inspect(study.recording("sweep"), study) if f.file == "sweep_markers.csv"]


def test_markers_become_metres(make_optical):
    time, markers = frames()
    study = make_optical(text_of(time, markers))
    slider = study.rig.slider
    assert (slider.low, slider.high, slider.marker) == pytest.approx((0.08, 0.24, "C"))
    recording = study.recording("sweep")
    optical = recording.optical
    assert recording.slider is None
    assert optical.path.name == "sweep_markers.csv"
    assert len(optical.checksum) == 64
    assert optical.carriage == "C"
    assert optical.down.tolist() == [0.0, 0.0, -1.0]
    assert optical.time == pytest.approx(time)
    assert optical.markers["R1"] == pytest.approx(markers["R1"] / 1000)
    assert faults(study) == []
    with pytest.raises(ValueError, match="read-only"):
        optical.markers["C"][0, 0] = 1.0


@pytest.mark.parametrize("lost", ["", "NaN", " ", "n/a"])
def test_a_lost_marker_is_missing_in_all_three(make_optical, lost):
    time, markers = frames()
    markers["C"][100:200] = np.nan
    markers["C"][-1] = markers["R1"][300:] = np.nan
    markers["C"][50, 1] = np.nan
    optical = make_optical(text_of(time, markers, lost)).recording("sweep").optical
    assert np.isnan(optical.markers["C"]).sum() == 3 * 102
    assert np.isnan(optical.markers["C"][50]).all()
    assert optical.seen("R1").tolist() == [True] * 300 + [False] * (len(time) - 300)
    known = optical.seen("C")
    assert optical.markers["C"][known] == pytest.approx(markers["C"][known] / 1000)


def test_a_row_of_other_length_is_told_beside_empty_cells(make_optical):
    time, markers = frames()
    markers["C"][5] = np.nan
    lines = text_of(time, markers).splitlines()
    for i in range(1500, 1700):
        lines[i] = lines[i][:-30]
    study = make_optical("\n".join(lines) + "\n")
    with pytest.raises(RecordingError, match=r"sweep_markers.csv: line 1501 has .* fields, expected"):
        study.recordings()


def test_a_last_row_that_is_cut_off_is_left_out_and_told(make_optical):
    study = make_optical(text_of(*frames())[:-30])
    recording = study.recording("sweep")
    assert len(recording.optical) == len(frames()[0]) - 1
    (fault,) = [fault for fault in inspect(recording, study) if fault.severity == "cut"]
    assert "sweep_markers.csv (recording sweep), time: found an incomplete last row" in fault.message


def test_columns_of_another_name(make_optical):
    time, markers = frames()
    text = text_of(time, markers).replace("C_", "arm:C.").replace("R1_", "arm:R1.")
    study = make_optical(text, ("down", 'columns = "arm:{marker}.{axis}"\ndown'))
    assert study.recording("sweep").optical.markers["C"] == pytest.approx(markers["C"] / 1000)


def test_a_position_by_ruler_needs_no_optical_file(make_optical):
    recording = make_optical(append='slider = "15.2 cm"\n').recording("sweep")
    assert recording.slider == pytest.approx(0.152)
    assert recording.optical is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('high = "24 cm"', 'high = "50 mm"', "[rig] slider: found low = 0.08 m not below high = 0.05 m"),
        ('low = "80 mm"', "low = 80", '[rig.slider] low: found 80 without a unit, expected e.g. "80 m"'),
        ('marker = "C"', 'marker = "D"', '[rig.slider] marker: found "D", expected one of [optical] markers: C, R1'),
        ('marker = "C"\n', "", "found optical, expected [rig.slider] marker: which one is on the carriage"),
        ('marker = "C"', 'marke = "C"', 'unknown key "marke"; the nearest valid one is "marker"'),
        ('unit = "mm"', 'unit = "deg"', '[optical] unit: found the unit "deg", expected "m"'),
        ('unit = "s" }\nunit', 'unit = "m" }\nunit', '[optical] time: found the unit "m", expected "s"'),
        ('time = { column = "time", unit = "s" }\n', "", "[optical] time: missing, and it has no default"),
        ('{ column = "time", unit = "s" }\nunit', '"time"\nunit', "[optical] time: found 'time', expected a table"),
        ('["C", "R1"]', '["C", "C"]', "[optical] markers: found ['C', 'C'], expected at least one, each once"),
        ("down", 'columns = "{marker}"\ndown', '[optical] columns: found "{marker}", expected {marker} and {axis}'),
        ("[0, 0, -2]", "[0, 0, 0]", "[optical] down: found [0, 0, 0], which points nowhere"),
        ("[0, 0, -2]", "[0, -1]", "[optical] down: found [0, -1], expected three numbers such as [0, 0, -1]"),
        ("[optical]", "[optic]", 'unknown key "optic"; the nearest valid one is "optical"'),
        (OPTICAL, "", "[[recordings]] sweep: found optical, expected a table [optical]"),
        ('file = "recordings/sweep.csv"', 'files = "recordings/*.csv"', "state one file for each recording"),
        ('use = "fit"', 'slider = "0.3 m"', "found slider = 0.3 m, expected 0.08 m to 0.24 m as [rig.slider] says"),
        (RAIL, "[rig.loop]\nkind = 'p'\nkp = 1.0\n", None),
    ],
)  # fmt: skip
def test_a_wrong_study_file(make_optical, old, new, message):
    if message is None:  # an axis may be wanted without a slider
        assert make_optical(None, (old, new)).rig.slider is None
        return
    with pytest.raises(StudyError) as error:
        make_optical(None, (old, new))
    assert message in str(error.value)


def test_a_ruler_without_a_rail(make_study):
    with pytest.raises(StudyError, match=r"sweep: found slider, expected a table \[rig.slider\]"):
        make_study(None, append='slider = "0.1 m"\n')


def test_a_slide_has_no_slider(make_study):
    changes = [("rotary", "prismatic"), ('torque_constant = "2 N*m/A"', ""), ('unit = "rad"', 'unit = "m"')]
    with pytest.raises(StudyError, match=r'found \[rig.slider\] with motion = "prismatic", expected "rotary"'):
        make_study(None, *changes, ("[channels]", f"{RAIL}\n[channels]"))


def test_the_schema_for_editors_knows_the_optical_keys(make_optical):
    import tomllib

    import jsonschema

    from pellucid.study.procedures.registry import study_model
    from pellucid.study.study_file import json_schema

    raw = tomllib.loads((make_optical().folder / "study.toml").read_text())
    jsonschema.validate(raw, json_schema(study_model()))
    raw["optical"]["unti"] = "mm"
    with pytest.raises(jsonschema.ValidationError, match="unti"):
        jsonschema.validate(raw, json_schema(study_model()))


def test_a_missing_optical_file(make_optical):
    with pytest.raises(
        RecordingError,
        match=r'sweep_markers.csv: no such file, expected by optical of \[\[recordings\]\] "sweep"; recordings holds',
    ):
        make_optical().recordings()


def test_a_missing_marker_column(make_optical):
    time, markers = frames()
    text = text_of(time, {"C": markers["C"], "R2": markers["R1"]})
    with pytest.raises(RecordingError) as error:
        make_optical(text).recordings()
    assert str(error.value) == (
        'sweep_markers.csv: channel of marker R1 expects a column "R1_x", found time, C_x, C_y, C_z, R2_x, R2_y, R2_z; '
        'the nearest is "R2_x"'
    )


def test_a_marker_of_the_wrong_shape(tmp_path):
    with pytest.raises(RecordingError, match=r"m.csv: marker C: found shape \(3, 2\), expected \(3, 3\)"):
        OpticalRecording(tmp_path / "m.csv", "", np.arange(3.0), {"C": np.zeros((3, 2))}, np.array([0, 0, -1]))
    with pytest.raises(RecordingError, match=r"m.csv: found the markers R1, expected C, the carriage's, among them"):
        OpticalRecording(tmp_path / "m.csv", "", np.arange(3.0), {"R1": np.zeros((3, 3))}, np.array([0, 0, -1]), "C")


@pytest.mark.parametrize(
    ("marker", "lost", "severity", "found"),
    [
        ("C", slice(500, 590), "note", "it lost in 90 of 1790 frames, the longest loss 0.503 s after 2.7933 s"),
        ("C", slice(400, None), "refuse", "it in 400 of 1790 frames"),
        ("C", slice(None), "refuse", "it in 0 of 1790 frames"),
        ("R1", slice(None), "note", "it in 0 of 1790 frames"),
        ("R1", slice(10, None), "note", "it lost in 1780 of 1790 frames, the longest loss 9.94 s after 0.0558659 s"),
    ],
)
def test_lost_markers(make_optical, marker, lost, severity, found):
    time, markers = frames()
    markers[marker][lost] = np.nan
    study = make_optical(text_of(time, markers))
    (fault,) = faults(study)
    assert (fault.severity, fault.kind, fault.channel, fault.found) == (severity, "lost_marker", marker, found)
    assert f"sweep_markers.csv (recording sweep), marker {marker}: found it" in fault.message
    if severity == "refuse":
        assert fault.expected.startswith("at least 448: ")
        with pytest.raises(RecordingError, match="marker C"):
            require_sound(study.recording("sweep"), study)


def test_a_blink_is_not_told(make_optical):
    time, markers = frames()
    markers["C"][700:712] = np.nan
    assert faults(make_optical(text_of(time, markers))) == []


def test_too_few_frames(make_optical):
    (short, fault) = faults(make_optical(text_of(*frames(1.0))))
    assert (short.severity, short.kind, short.found) == ("refuse", "lost_marker", "it in 179 of 179 frames")
    assert (fault.severity, fault.kind, fault.found) == ("note", "overlap", "0 s to 0.9944 s")


@pytest.mark.parametrize(
    ("change", "kind", "found"),
    [
        (lambda t: np.where(t > 5, t - 1, t), "time_order", "5 s, then 4.00559 s at index 896, 1 such steps in all"),
        (lambda t: np.where(t > 5, np.nan, t), "missing_samples", "894 missing samples (NaN)"),
        (lambda t: t + 1e9, "overlap", "1e+09 s to 1e+09 s"),
    ],
)
def test_a_wrong_clock(make_optical, change, kind, found):
    time, markers = frames()
    (fault,) = faults(make_optical(text_of(change(time), markers)))
    assert (fault.severity, fault.kind, fault.channel, fault.found) == ("refuse", kind, "time", found)


def test_units_that_cannot_be_right(make_optical):
    text = text_of(*frames())
    (fault,) = faults(make_optical(text, ('"mm"\nmarkers', '"m"\nmarkers')))
    assert (fault.severity, fault.kind) == ("refuse", "magnitude")
    assert "which looks like mm taken for m" in fault.found
    time, markers = frames()
    (fault,) = faults(make_optical(text_of(time, {m: p / 1000 for m, p in markers.items()})))
    assert (fault.severity, fault.kind) == ("refuse", "magnitude")
    assert "which looks like m taken for mm" in fault.found
