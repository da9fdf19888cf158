"""What is bad in a recording is left out, what is good on either side of it is used, and it is told."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError, RecordingError, StudyError
from pellucid.files.cut import Cut, sound_samples, spans_between
from pellucid.files.defects.spikes import _high_quantile
from pellucid.joint.study.aligned_motions import aligned_motions
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify

EXCLUDED = ('use = "fit"', 'use = "fit"\nexclude = [["4 s", "4.1 s"]]')


def test_what_is_left_between_cuts():
    cuts = [
        Cut("gap", "time", 4.0, 5.0, 4, 3, "a gap"),
        Cut("spike", "position", 7.0, 9.0, 7, 8, "a spike"),
        Cut("missing_samples", "current", 8.0, 10.0, 8, 9, "no number"),
    ]
    assert spans_between(12, cuts) == (slice(0, 4), slice(4, 7), slice(10, 12))
    assert np.flatnonzero(~sound_samples(12, cuts)).tolist() == [7, 8, 9]
    assert spans_between(3, ()) == (slice(0, 3),)
    assert spans_between(3, [Cut("excluded", "time", 0.0, 3.0, 0, 2, "all of it")]) == ()


def test_what_is_excluded_by_hand_takes_no_part(make_study):
    columns = make_study.swing()
    clean = identify(make_study(columns), families=["symmetric"], thorough=False)
    columns["i"] = columns["i"].copy()
    columns["i"][800:820] += 1.0
    study = make_study(columns, EXCLUDED)
    first, second = aligned_motions(study)
    assert (len(first.time), second.time[0]) == (800, 4.1)
    assert second.initial[1] != 0.0
    found = identify(study, families=["symmetric"], thorough=False)
    for name in ("inertia", "gravity", "coulomb"):
        assert found[name].value == pytest.approx(clean[name].value, rel=0.01)
    told = "found what study.toml excludes at 4 s (samples 800 to 819), cut out"
    assert any(told in verdict.text for verdict in found.verdicts)
    assert [f.kind for f in check(study) if f.severity == "cut"] == ["excluded"]


def test_a_stretch_between_cuts_that_is_too_short_is_told(make_study):
    study = make_study(None, ('use = "fit"', 'use = "fit"\nexclude = [["4 s", "4.1 s"], ["4.2 s", "4.3 s"]]'))
    assert len(aligned_motions(study)) == 2
    (told,) = [fault for fault in check(study) if fault.kind == "short_stretch"]
    assert told.severity == "cut"
    assert "found 20 samples between cuts, from 4.1 s to 4.195 s, expected at least 190; excluded" in told.message


def test_an_exclusion_that_cannot_be_meant(make_study):
    with pytest.raises(RecordingError, match=r"exclude 60 s to 70 s holds no sample, found times from 0 s to 9.995 s"):
        make_study(None, ('use = "fit"', 'use = "fit"\nexclude = [["60 s", "70 s"]]')).recordings()
    with pytest.raises(StudyError, match=r"exclude: found 3 s to 1 s, expected start before end"):
        make_study(None, ('use = "fit"', 'use = "fit"\nexclude = [["3 s", "1 s"]]'))


def spoilt(make_study, name, where, value, *changes):
    columns = make_study.swing()
    columns[name] = columns[name].copy()
    columns[name][where] = value(columns[name][where]) if callable(value) else value
    return make_study(columns, *changes)


DEFECTS = {
    "spike": ("q", slice(620, 621), lambda q: q + 0.5, "a spike of 0.499 rad", "sample 620"),
    "wide spike": ("q", slice(620, 624), lambda q: q - 0.3, "a spike of 0.3", "samples 620 to 623"),
    "spike of the drive": ("i", slice(620, 621), 1e27, "a spike of 1e+27 A", "sample 620"),
    "missing": ("i", slice(620, 660), np.nan, "40 missing samples (NaN)", "samples 620 to 659"),
    "dropout": ("i", slice(620, 650), 0.0, "a dropout, the one value 0 A in 30 samples", "samples 620 to 649"),
    "held": ("i", slice(620, 650), lambda i: i[0], "a dropout, the one value", "samples 620 to 649"),
    "frozen": ("q", slice(620, 650), lambda q: q[0], "a frozen encoder, the one value", "samples 620 to 649"),
}


@pytest.mark.parametrize("name", DEFECTS)
def test_a_defect_is_cut_out_and_told(make_study, name):
    column, where, value, found, samples = DEFECTS[name]
    clean = identify(make_study(), families=["symmetric"], thorough=False)
    study = spoilt(make_study, column, where, value)
    made = identify(study, families=["symmetric"], thorough=False)
    told = [v.text for v in made.verdicts if "cut out" in v.text]
    assert len(told) == 1
    assert found in told[0]
    assert f"({samples})" in told[0]
    for each in ("inertia", "gravity", "coulomb"):
        assert made[each].value == pytest.approx(clean[each].value, rel=0.01)
    with pytest.raises(RecordingError, match=r'or \[processing\] cut = "automatic"'):
        identify(spoilt(make_study, column, where, value, ("[processing]", '[processing]\ncut = "none"')))


def test_a_clean_recording_is_not_cut(make_study, rng):
    columns = make_study.swing()
    noisy = {n: x if n == "t" else x + 0.02 * x.std() * rng.standard_normal(len(x)) for n, x in columns.items()}
    coarse = {n: x if n == "t" else np.round(x / 0.02) * 0.02 for n, x in columns.items()}
    steps = columns | {"i": 1.5 * np.sign(np.sin(2 * np.pi * 0.7 * columns["t"]))}
    rests = columns | {"i": np.where(columns["t"] % 2 < 0.5, 0.0, columns["i"])}
    knock = columns | {"q": columns["q"] + 0.05 * (columns["t"] > 4) * np.exp(-20 * abs(columns["t"] - 4))}
    for made in (columns, noisy, coarse, steps, rests, knock):
        assert make_study(made).recording("sweep").cuts == ()


def test_more_than_a_tenth_cut_out_refuses(make_study):
    study = spoilt(make_study, "q", slice(700, 950), np.nan)
    with pytest.raises(
        RecordingError, match=r"found 250 of 2000 samples bad \(12.5 %\): 250 missing samples \(NaN\) in"
    ):
        identify(study)
    wider = spoilt(make_study, "q", slice(700, 950), np.nan, ("[processing]", "[processing]\ncut_share = 0.2"))
    assert identify(wider, families=["symmetric"], thorough=False)["inertia"].value > 0.0


def test_stamps_that_jitter_and_samples_that_do(make_study, rng):
    clean = make_study.swing()
    late = 0.3 * rng.uniform(-1, 1, 2000) / 200.0
    stamps = make_study(clean | {"t": clean["t"] + late}).recording("sweep")
    assert stamps.stamped_evenly
    taken = {name: np.interp(clean["t"] + late, clean["t"], x) for name, x in clean.items()}
    study = make_study(taken)
    assert not study.recording("sweep").stamped_evenly
    found = identify(study, families=["symmetric"], thorough=False)
    assert found["inertia"].value == pytest.approx(0.05, rel=0.02)


def test_a_last_row_that_is_cut_off_is_dropped_and_told(make_study):
    study = make_study()
    path = study.recordings()[0].path
    text = path.read_text()
    for end in (text[:-30], text[: text.rindex(",") + 4]):
        path.write_text(end)
        recording = open_study(study.folder).recording("sweep")
        assert len(recording) == 1999
        assert [cut.kind for cut in recording.cuts] == ["truncated"]
        assert recording.cuts[0].found.startswith("an incomplete last row, ")
    path.write_text(text.rstrip("\n"))
    whole = open_study(study.folder).recording("sweep")
    assert (len(whole), whole.cuts) == (2000, ())
    lines = text.splitlines()
    lines[700] = lines[700].rpartition(",")[0]
    path.write_text("\n".join(lines) + "\n")
    damaged = open_study(study.folder).recording("sweep")
    assert len(damaged) == 1999
    assert [cut.kind for cut in damaged.cuts] == ["gap", "damaged_rows"]
    assert damaged.cuts[1].found == "excluded 1 row that is damaged: line 701 has 2 fields, expected 3"


def test_a_recording_is_not_judged_by_itself(make_study):
    again = '\n[[recordings]]\nname = "again"\nfile = "recordings/{}.csv"\nuse = "validate"\n'
    study = make_study(append=again.format("copy"))
    path = study.folder / "recordings" / "sweep.csv"
    head, *rows = path.read_text().splitlines()
    later = [f"{float(t) + 100.0!r},{rest}" for t, rest in (row.split(",", 1) for row in rows)]
    path.with_name("copy.csv").write_text("\n".join([head, *later]) + "\n")
    with pytest.raises(RecordingError, match=r"copy.csv \(recording again\): found the same samples as in sweep.csv"):
        identify(study)
    assert [f.kind for f in check(study) if f.severity == "refuse"] == ["duplicate"]
    windows = make_study(None, ('use = "fit"', 'use = "fit"\nwindow = ["0 s", "6 s"]'), append=again.format("sweep"))
    assert [f.kind for f in check(windows) if f.severity == "refuse"] == ["duplicate"]


def test_one_recording_of_two_with_its_drive_reversed(make_study):
    columns = make_study.swing()
    again = '\n[[recordings]]\nname = "again"\nfile = "recordings/again.csv"\n'
    study = make_study(columns, append=again)
    rows = np.column_stack([columns["t"], columns["q"], -columns["i"]])[100:]
    np.savetxt(study.folder / "recordings" / "again.csv", rows, delimiter=",", header="t,q,i", comments="")
    with pytest.raises(IdentificationError, match=r"recording again: .* the sign of the drive or of the position"):
        identify(study)


def test_a_held_out_recording_without_a_usable_stretch_is_named_and_refuses_nothing(make_study):
    judged = '\n[[recordings]]\nname = "judged"\nfile = "recordings/judged.csv"\nuse = "validate"\n'
    judged += 'exclude = [["0.5 s", "9.5 s"]]\n'
    columns = make_study.swing()
    study = make_study(columns, append=judged)
    short = {name: column * (1.0 if name == "t" else 1.01) for name, column in columns.items()}
    lines = [
        ",".join(short),
        *(",".join(map(repr, row)) for row in zip(*(c.tolist() for c in short.values()), strict=True)),
    ]
    (study.folder / "recordings" / "judged.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    study = open_study(study.folder)
    (told,) = [fault for fault in check(study) if fault.kind == "short_stretch"]
    assert "judged.csv (recording judged): found 2000 samples, no enabled stretch of at least 190" in told.message
    alone = identify(make_study(columns), families=["symmetric"], thorough=False)
    study = make_study(columns, append=judged)
    found = identify(study, families=["symmetric"], thorough=False)
    for name in ("inertia", "gravity", "coulomb"):
        assert found[name].value == alone[name].value
    assert any("it is held out, and is excluded" in verdict.text for verdict in found.verdicts)


@pytest.mark.parametrize("n", [48, 1999, 2000, 50_001])
def test_a_high_quantile_is_numpys(n):
    rng = np.random.default_rng(n)
    draws = rng.exponential(size=n)
    for values in (draws, np.round(draws), np.zeros(n), np.sort(rng.normal(size=n))):
        assert _high_quantile(values, 0.99) == np.quantile(values, 0.99)
