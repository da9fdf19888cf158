"""Every rig's study: what it says is what the first five hand-written ones said, and those still open."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from pellucid._errors import StudyError
from pellucid.numerics.protocols.excitation import REVERSALS_NAME
from pellucid.study.procedures.registry import open_study
from pellucid_lab.knee.rig import NAMES as PLANT
from pellucid_lab.known_rigs import load_rig, parse_rig, rig_names
from pellucid_lab.pointing.rig import PointingRig
from pellucid_lab.recorded_table import MAIN_STREAM, Column, StoredTable
from pellucid_lab.rig import Taken
from pellucid_lab.strap_options import STRAP_OPTIONS, without_strap_options
from pellucid_lab.study import study_config
from pellucid_lab.study_text import study_text

KEPT = Path(__file__).parents[1] / "data" / "5239fe4" / "lab"
"""Each rig's file and the study.toml that `simulate` wrote of it with seed 1, as of that commit."""

RIGS = sorted(folder.name for folder in KEPT.iterdir())


def pretended(rig):
    """Every trial as if it had been recorded, without a sample: what the study needs of it."""
    streams = rig.streams()
    empty = {stream: StoredTable(tuple(columns), np.empty((0, len(columns)))) for stream, columns in streams.items()}
    for trial in rig.trials(1):
        files, entry = {trial.name: {MAIN_STREAM: empty[MAIN_STREAM]}}, {}
        if "markers" in empty:
            files[trial.name]["markers"] = empty["markers"]
        if getattr(trial, "wearer", None) is not None or getattr(trial, "subject", None) is not None:
            files[trial.name]["emg"] = empty["emg"]
        if getattr(trial, "imu", None) is not None:
            files[trial.name]["imu"] = empty["imu"]
        if getattr(trial, "subject", None) is not None:
            once = np.random.default_rng([rig["difference"]["seed"], 7, *trial.subject.name.encode()])
            knee = trial.subject.rest + rig["posture"]["goniometer"] * once.standard_normal(2)[0]
            entry = {"channels": {"angle.knee": {**streams[MAIN_STREAM][1].spec, "offset": round(float(knee), 4)}}}
        if isinstance(rig, PointingRig):
            from pellucid_lab.pointing.instruments import COMMON_COLUMNS, ROBOT_COLUMNS

            own = COMMON_COLUMNS if trial.condition == "Ctrl" else (*COMMON_COLUMNS, *ROBOT_COLUMNS)
            streams_of_block = {**empty, MAIN_STREAM: StoredTable(own, np.empty((0, len(own))))}
            files = {f"{trial.name}_{i}": streams_of_block for i in (1, 2)}
        yield Taken(trial, files, entry)


@pytest.mark.parametrize("name", RIGS)
def test_a_study_says_what_it_said_when_it_was_written_by_hand(name):
    rig = load_rig(name)
    before = open_study(KEPT / name).config
    # Reversals and instruments came later.
    said = rig.study([taken for taken in pretended(rig) if taken.trial.protocol != REVERSALS_NAME])
    said["rig"].pop("instruments", None)
    text = study_text(said, rig.comments)
    assert study_config(tomllib.loads(text)) == before
    assert study_config(said) == before
    assert text.startswith("# ")
    assert [line for line in text.splitlines() if len(line) > 160] == []


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_that_was_kept_is_the_one_that_is_shipped(name):
    kept = parse_rig((KEPT / name / "lab" / "rig.toml").read_text(encoding="utf-8"), name)
    shipped = load_rig(name)
    assert type(kept) is type(shipped)
    # Rigs have since got straps that are more than a spring and a damper.
    assert list(_said_of(kept.tables, shipped.tables)) == []


STRAP = {name for names in STRAP_OPTIONS.values() for name in names} | {"relaxation_time", "hold", "fitted"}
"""What rigs have since learnt to say of straps, or to say otherwise."""


def _said_of(before, now, path=""):
    """Where a table no longer says what it said before; of what it says besides, nothing was known then."""
    for key, value in before.items():
        if key == "kind" or (path.endswith("strap") and key in STRAP):
            continue
        if isinstance(value, dict):
            yield from _said_of(value, now.get(key, {}), f"{path}.{key}")
        elif now.get(key) != value:
            yield f"{path}.{key}"


def test_a_rig_that_was_kept_has_straps_that_are_springs_with_dampers():
    knee = parse_rig((KEPT / "knee-orthosis" / "lab" / "rig.toml").read_text(encoding="utf-8"), "knee-orthosis")
    plain = load_rig("knee-orthosis").strapped({**without_strap_options(), "hold": 15.0})
    elbow = parse_rig((KEPT / "elbow-participants" / "lab" / "rig.toml").read_text(encoding="utf-8"), "x")
    for name, subject in knee.subjects.items():
        values, shipped = knee.plant(subject), plain.plant(plain.subjects[name])
        differ = [PLANT[i] for i in np.flatnonzero(values != shipped)]
        # Of no consequence without what it belongs to.
        assert set(differ) <= {"strap_relaxation_time"}
        assert all(values[PLANT.index(f"strap_{n}")] == 0 for n in without_strap_options() if n != "askew_spread")
    np.testing.assert_array_equal(elbow.strap, [120.0, 1.2, *[0.0] * 9])


@pytest.mark.parametrize("name", RIGS)
def test_a_truth_can_be_written(name):
    rig = load_rig(name)
    assert json.loads(json.dumps(rig.truth(1)))


def test_a_kind_that_nobody_knows_is_refused():
    known = "bench-joint, elbow-participants, elbow-people, knee"
    with pytest.raises(StudyError, match=f"found kind = 'ankle', expected one of {known}"):
        parse_rig('kind = "ankle"\n', "mine")
    with pytest.raises(StudyError, match="unknown rig 'shoulder'"):
        load_rig("shoulder")
    assert set(RIGS) < set(rig_names())


def test_text_of_a_study_reads_back():
    said = {
        "recordings": [{"name": "a", "streams": {"emg": "a_emg.csv"}, "channels": {"angle.knee": {"column": 'a "b"'}}}],
        "rig": {"drive": {"kind": "torque"}, "lifts": "flexion", "fine": 1e-7, "yes": True, "list": [1, "µ"]},
        "loaded_swing": {},
        "name": "x",
    }
    text = study_text(said, {"": "one\ntwo", "rig.lifts": "why"})
    assert text.startswith('# one\n# two\nname = "x"\n\n[rig]\nlifts = "flexion"')
    assert "# why" in text
    read = tomllib.loads(text)
    read["recordings"][0]["channels"] = {"angle.knee": read["recordings"][0]["channels"]["angle"]["knee"]}
    assert read == said


def test_the_text_of_a_table_is_that_of_its_formats():
    rng = np.random.default_rng(1)
    texts = ("%d", "%.3f", "%.5f", "%d")
    columns = [Column(name, name, "V", text=text) for name, text in zip("abcd", texts, strict=True)]
    table = StoredTable.of(columns, rng.normal(0.0, 3e3, (200, 4)), comment="# one\n")
    rows = "".join((",".join(texts) + "\n") % tuple(row) for row in table.values.tolist())
    assert table.text == f"# one\na,b,c,d\n{rows}"
    # A format that is not of fixed decimals is Python's own.
    columns = [Column("a", "a", "V", text="%r"), Column("b", "b", "V")]
    free = StoredTable.of(columns, np.array([[0.1, 2.0], [1e-9, 3.0]]))
    assert free.text == "a,b\n0.1,2\n1e-09,3\n"
