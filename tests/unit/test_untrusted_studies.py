"""A stranger's study: what it names lies in its folder, what it says is in range, and nothing ends in a traceback."""

import os

import numpy as np
import pytest
from research.evidence._healthy import healthy
from research.evidence._mutations import damaged_toml

import pellucid as pl
from pellucid._errors import PellucidError, RecordingError, StudyError
from pellucid.study.procedures.registry import open_study

EACH = int(os.environ.get("FUZZ", "300"))


@pytest.fixture
def outside(tmp_path, make_study):
    """A study, and a recording beside its folder."""
    study = make_study()
    path = tmp_path / "outside.csv"
    (study.folder / "recordings" / "sweep.csv").rename(path)
    return study.folder, path


def reads(folder, **options):
    return len(open_study(folder, **options).recordings()[0])


@pytest.mark.parametrize("how", ["relative", "absolute", "link", "linked folder", "pattern", "absolute pattern"])
def test_what_lies_outside_is_read_only_where_that_is_said(outside, how):
    folder, path = outside
    named = 'file = "recordings/sweep.csv"'
    if how == "link":
        (folder / "recordings" / "sweep.csv").symlink_to(path)
    elif how == "linked folder":
        (folder / "recordings").rmdir()
        (folder / "recordings").symlink_to(path.parent)
        path.rename(path.with_name("sweep.csv"))
    else:
        said = {
            "relative": 'file = "../outside.csv"',
            "absolute": f'file = "{path}"',
            "pattern": 'files = "../*.csv"',
            "absolute pattern": f'files = "{path.parent}/*.csv"',
        }[how]
        text = (folder / "study.toml").read_text().replace(named, said)
        (folder / "study.toml").write_text(text)
    with pytest.raises(PellucidError, match=r"outside the study's folder, expected a file in it; --allow-outside"):
        reads(folder)
    if how == "absolute pattern":  # a pattern starts in the folder
        with pytest.raises(RecordingError, match="files = "):
            reads(folder, allow_outside=True)
    else:
        assert reads(folder, allow_outside=True) == 2000


def test_a_study_file_that_leads_elsewhere_is_not_read(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("the secret word")
    (tmp_path / "bench").mkdir()
    (tmp_path / "bench" / "study.toml").symlink_to(secret)
    with pytest.raises(PellucidError, match="outside the study's folder") as told:
        open_study(tmp_path / "bench")
    assert "secret word" not in str(told.value)


def test_a_pipe_is_not_waited_for(tmp_path, make_study):
    folder = make_study().folder
    (folder / "study.toml").unlink()
    os.mkfifo(folder / "study.toml")
    with pytest.raises(PellucidError, match=r"study\.toml: found no regular file, expected one"):
        open_study(folder)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "A"', 'unit = "A*9**9**9"', "unknown unit"),
        ('unit = "A"', 'unit = "((9^99)^99)^99"', "unknown unit"),
        ('torque_constant = "2 N*m/A"', 'torque_constant = "5e-324 N*m/A"', "expected 0 or from 1e-15 to 1e"),
        ('lowpass = "20 Hz"', 'lowpass = "1e30 Hz"', "expected 0 or from 1e-15 to 1e"),
        ('motion = "rotary"', "motion = []", "expected 'rotary' or 'prismatic'"),
        ('joint = "elbow"', 'joint = "../../elbow"', r"joint: found '../../elbow', expected letters, digits"),
        ('joint = "elbow"', 'joint = "$x^2$"', "expected letters, digits"),
        ('lifts = "flexion"', 'lifts = "\\u001b[2J"', "characters that can be seen"),
        ('lifts = "flexion"', 'lifts = "\\u202efdp"', "characters that can be seen"),
        ('protocol = "multisine"', 'participant = "a/b"', "expected letters, digits"),
        ('name = "bench"', f"name = {'9' * 5000}", "not valid TOML"),
        ('name = "bench"', "name = " + "[" * 5000, "not valid TOML"),
        ('file = "recordings/sweep.csv"', 'files = "**.csv"', "files = "),
        ('file = "recordings/sweep.csv"', 'file = "a\\u0000b"', "characters that can be seen"),
    ],
)
def test_what_a_study_says_is_in_range(make_study, old, new, message):
    with pytest.raises((StudyError, RecordingError), match=message) as told:
        make_study(None, (old, new)).recordings()
    assert len(str(told.value)) < 2000


def test_an_even_grid_does_not_swell(make_study):
    study = make_study(None, ('lowpass = "20 Hz"', 'lowpass = "20 Hz"\nresample = "1e9 Hz"'))
    with pytest.raises(PellucidError, match=r"resampling: found 2000 samples from 0 s to 9\.995 s"):
        pl.identify(study, thorough=False)


def test_a_file_name_means_nothing_in_a_page_or_a_formula(make_study):
    study = make_study(None, ('file = "recordings/sweep.csv"', 'files = "recordings/*.csv"'))
    for name in ("$x^2$<b>.csv", "a*\\n.csv"):
        (study.folder / "recordings" / name).write_bytes((study.folder / "recordings" / "sweep.csv").read_bytes())
    assert {r.name for r in study.recordings()} == {"sweep.sweep", "sweep._x_2__b_", "sweep.a__n"}


def test_every_study_file_is_answered(tmp_path):
    folder = next(folder for folder in healthy(tmp_path, 400) if folder.name == "csv-0")
    text = (folder / "study.toml").read_text()
    opened = refused = 0
    for seed in range(EACH):
        (folder / "study.toml").write_bytes(damaged_toml(text, np.random.default_rng([seed, 1])))
        try:
            pl.check(pl.open(folder))
            opened += 1
        except PellucidError:
            refused += 1
    assert opened + refused == EACH
    assert opened
    assert refused


@pytest.mark.parametrize("folder", ["models", "report", "kept", "tables"])
def test_nothing_is_written_where_a_link_leads(tmp_path, make_study, folder):
    study = make_study()
    (tmp_path / "outside").mkdir()
    (study.folder / folder).symlink_to(tmp_path / "outside")
    with pytest.raises(PellucidError, match="outside the study's folder"):
        study.place(folder)
    assert not list((tmp_path / "outside").iterdir())


def test_what_was_kept_by_somebody_else_is_found_again(make_study, monkeypatch, tmp_path):
    """With the right fingerprint, but other numbers."""
    from dataclasses import replace

    from pellucid.study.kept import keep_result
    from pellucid.study.procedures.registry import asked
    from pellucid.study.procedures.result import Result, fingerprint

    study = make_study()
    result = pl.identify(study, families=["symmetric"], thorough=False)
    result.save(study)
    (procedure,), path = asked(study), study.kept_path("joint")
    assert Result.kept(study, procedure) is not None
    monkeypatch.setenv("PELLUCID_SETTINGS", str(tmp_path / "theirs"))
    keep_result(path, fingerprint(study, procedure), replace(result.for_page(), headline="nothing is wrong"))
    monkeypatch.undo()
    assert Result.kept(study, procedure) is None
    # What cannot be drawn is found again too.
    keep_result(path, fingerprint(study, procedure), replace(result, families="none", rows=3))
    said = []
    assert pl.report(study, on_progress=lambda text, share: said.append(text)).is_file()
    assert "identify again, because its kept results are outdated" in said


def test_a_study_file_as_long_as_a_book_is_refused_at_once(make_study):
    study = make_study()
    path = study.folder / "study.toml"
    text = path.read_text()
    path.write_text(text + "# " + "x" * 3_000_000)
    with pytest.raises(PellucidError, match="bytes, expected at most 3000000"):
        open_study(study.folder)
    # A line that takes a search for its key longer than the study is old.
    path.write_text('notes = ["""[' + " " * 9000 + '"""]\nrate = 1\n' + text)
    with pytest.raises(StudyError, match="rate"):
        open_study(study.folder)
