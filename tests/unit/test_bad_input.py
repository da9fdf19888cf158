"""Whatever a lab may hand in wrong, from its folder to the message it reads."""

import numpy as np
import pytest
import scipy.io

from pellucid._errors import DatasetError, PellucidError, RecordingError, StudyError, UnfitRecordingError
from pellucid.study.datasets import init
from pellucid.study.procedures.registry import open_study
from pellucid.study.quality import require_sound
from pellucid.study.results import read_rows


def complaint(study_or_make):
    """What a person reads who asks for sound recordings."""

    def use():
        study = study_or_make() if callable(study_or_make) else study_or_make
        for recording in study.recordings():
            require_sound(recording, study)

    with pytest.raises(PellucidError) as error:
        use()
    return type(error.value), str(error.value)


def with_columns(make_study, **changes):
    columns = make_study.swing()
    for name, change in changes.items():
        columns[name] = change(columns[name].copy())
    return make_study(columns)


def put(where, value):
    def change(samples):
        samples[where] = value if np.isscalar(value) else value(samples)
        return samples

    return change


BAD_COLUMNS = {
    "NaN run": (
        {"q": put(slice(40, 540), np.nan)},
        ": found 500 of 2000 samples bad (25 %): 500 missing samples (NaN) in position from sample 40 on, expected at "
        "most 10 %; a window without them, or [processing] cut_share",
    ),
    "clipped channel": (
        {"i": lambda i: np.clip(i + 2.0 * np.sin(11.0 * np.arange(len(i)) / 200.0), -0.9, 0.9)},
        "at the largest value 0.9 A, expected flat tops in at most 2 % of the samples, which are cut out; if it is a "
        "limit that is meant to act, say so: "
        'current = { clip = "accept" } or [rig.drive] limit',
    ),
    "frozen encoder": (
        {"q": put(slice(600, 1100), lambda q: q[600])},
        "for 500 samples while",
    ),
    "non-monotonic time": (
        {"t": put(900, 4.0)},
        "channel time: found time running back at index 900 (4.495 s, then 4 s), 1 times in all, "
        "expected time that increases with every sample",
    ),
}


@pytest.mark.parametrize("name", BAD_COLUMNS)
def test_bad_samples(make_study, name):
    changes, message = BAD_COLUMNS[name]
    kind, text = complaint(with_columns(make_study, **changes))
    assert kind is UnfitRecordingError
    assert text.startswith("sweep.csv (recording sweep)")
    assert message in text


def test_too_few_samples(make_study):
    kind, text = complaint(make_study(make_study.swing(120)))
    assert kind is UnfitRecordingError
    assert text == (
        "sweep.csv (recording sweep), channel time: found 120 samples (0.6 s), "
        "expected at least 290: 50 are to be left after trim = 20 and decimate = 5"
    )


def test_a_missing_column(make_study):
    columns = make_study.swing()
    columns["current"] = columns.pop("i")
    kind, text = complaint(make_study(columns, ('column = "i"', 'column = "curent"')))
    assert kind is RecordingError
    assert text == (
        'sweep.csv: channel current expects a column "curent", found t, q, current; the nearest is "current"'
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((', unit = "A"', ""), 'line 15: [channels] current: no unit found, expected one such as "A"'),
        (
            ('unit = "A"', 'unit = "ampere hours"'),
            'line 15: [channels] current: found the unit "ampere hours", expected "A"',
        ),
        (('unit = "A"', 'unit = "N*m"'), 'line 15: [channels] current: found the unit "N*m", expected "A"'),
        (('unit = "rad"', 'unit = "mm"'), 'line 14: [channels] position: found the unit "mm", expected "rad"'),
        (('"rotary"', '"prismatic"'), 'line 14: [channels] position: found the unit "rad", expected "m"'),
        (
            ("decimate", "decimat"),
            'line 19: [processing] decimat: unknown key "decimat"; the nearest valid one is "dec',
        ),
    ],
)
def test_a_study_file_with_an_error(make_study, change, message):
    kind, text = complaint(lambda: make_study(None, change))
    assert kind is StudyError
    assert "study.toml, " in text
    assert message in text


def test_a_row_short_of_columns(make_study):
    study = make_study()
    path = study.folder / "recordings" / "sweep.csv"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:700], *["3.495,0.7\n"] * 200, *lines[900:]]))
    kind, text = complaint(study)
    assert kind is RecordingError
    assert text == "sweep.csv: line 701 has 2 fields, expected 3"


def test_an_empty_file(make_study):
    study = make_study()
    (study.folder / "recordings" / "sweep.csv").write_bytes(b"")
    assert complaint(study) == (
        RecordingError,
        "sweep.csv: the file is empty (0 bytes), expected recorded samples",
    )


def mat_study(make_study, variables):
    study = make_study(None, ("sweep.csv", "sweep.mat"))
    path = study.folder / "recordings" / "sweep.mat"
    scipy.io.savemat(path, variables)
    return study, path


def test_a_mat_file_with_other_fields(make_study):
    columns = make_study.swing()
    study, _ = mat_study(make_study, {"t": columns["t"], "q_elbow": columns["q"], "i": columns["i"]})
    kind, text = complaint(study)
    assert kind is RecordingError
    assert text == 'sweep.mat: channel position expects a column "q", found t, q_elbow, i'


def test_a_mat_file_with_fields_of_different_lengths(make_study):
    columns = make_study.swing()
    columns["i"] = columns["i"][:-3]
    assert complaint(mat_study(make_study, columns)[0]) == (
        RecordingError,
        "sweep.mat: channel current (column 'i') has 1997 samples, expected 2000 as in time",
    )


@pytest.mark.parametrize("share", [0.01, 0.5, 0.99])
def test_a_truncated_mat_file(make_study, share):
    study, path = mat_study(make_study, make_study.swing())
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    kind, text = complaint(study)
    assert kind is RecordingError
    assert text.startswith("sweep.mat: ")


def test_an_unknown_data_set(tmp_path):
    with pytest.raises(DatasetError, match=r'no data set "empz", expected one of .*; the nearest is "emps"'):
        init(tmp_path / "new", dataset="empz")
    assert not (tmp_path / "new").exists()


def test_a_folder_in_use(tmp_path):
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "thesis.tex").write_text("years of work")
    with pytest.raises(DatasetError, match=r"a folder that holds thesis.tex, expected a new or empty folder"):
        init(tmp_path / "used", dataset="emps")
    assert [p.name for p in tmp_path.rglob("*")] == ["used", "thesis.tex"]


def test_half_written_results(make_study):
    study = make_study()
    study.results_path.write_text('{"figures": [{"id": "bench.a", "value": 1.0, "un')
    with pytest.raises(RecordingError, match=r"results.json: not readable as JSON, truncated or damaged"):
        read_rows(study.results_path)


def test_a_recording_that_is_a_folder(make_study):
    study = make_study(None, ("recordings/sweep.csv", "recordings"))
    assert "no such file" in complaint(study)[1]


def test_a_study_that_is_a_file(tmp_path):
    (tmp_path / "a").write_text("")
    with pytest.raises(StudyError):
        open_study(tmp_path / "a")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[processing]",
            '[model]\nknown = { inertia = "-5 kg*m^2" }\n[processing]',
            "expected more than 0: every",
        ),
        ("[processing]", '[model]\nknown = { coulomb = "-1 N*m" }\n[processing]', "expected 0 or more: friction takes"),
        ("[processing]", '[model]\nknown = { inertia = "1e8 kg*m^2" }\n[processing]', "expected at most 100000 in SI"),
        ('"2 N*m/A"', '"6e9 N*m/A"', "[rig.drive] torque_constant: found 6000000000.0, expected at most 10000"),
        (
            '"2 N*m/A"',
            '"2 N*m/A"\ngear_ratio = 2e6',
            "[rig.drive] gear_ratio: found 2000000.0, expected at most",
        ),
        ('unit = "rad"', 'unit = "rad", wrap_bits = 2', "[channels] position.wrap_bits: found 2, expected at least 6"),
    ],
)
def test_nonsense_constants(make_study, old, new, message):
    kind, text = complaint(lambda: make_study(None, (old, new)))
    assert kind is StudyError
    assert "study.toml, line " in text
    assert message in text


def test_counts_that_do_not_roll_over_where_study_toml_says(make_study):
    columns = make_study.swing()
    columns["q"] = np.round(columns["q"] / 1e-4)
    kind, text = complaint(lambda: make_study(columns, ('unit = "rad"', 'unit = "rad", scale = 1e-4, wrap_bits = 10')))
    assert kind is RecordingError
    assert text.startswith("sweep.csv: channel position (column 'q'): found counts from -")
    assert text.endswith("expected all within 1024, as wrap_bits = 10 says")
