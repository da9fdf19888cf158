"""The guides on study.toml show tables that are valid, and the reference made of the code explains every key."""

import json
import re
import runpy
from pathlib import Path

import pytest

from pellucid.study import study_fields
from pellucid.study.procedures.registry import ALL_PROCEDURES, open_study

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
MADE = runpy.run_path(str(ROOT / "website" / "generated.py"))
MACHINE = """
[rig]
motion = "rotary"
[rig.drive]
kind = "current"
"""
CHANNELS = """
[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
current = { column = "i", unit = "A" }
"""
RECORDING = """
[[recordings]]
name = "one"
file = "one.csv"
"""


def examples(page: str) -> list[str]:
    """Return the tables of study.toml that a page shows."""
    return re.findall(r"```toml\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)


def study_of(tmp_path: Path, *tables: str):
    """Return the configuration of a study that has these tables."""
    (tmp_path / "study.toml").write_text("\n".join(('name = "shown"', *tables)), encoding="utf-8")
    return open_study(tmp_path).config


def test_the_whole_example_is_valid(tmp_path):
    (whole,) = examples("how-to/write-a-study-toml.md")
    (tmp_path / "study.toml").write_text(whole, encoding="utf-8")
    study = open_study(tmp_path).config
    assert study.name == "my-joint"
    assert study.channels["position"].si_unit == "rad"
    assert len(study.recordings) == 2


def test_the_example_of_several_joints_is_valid(tmp_path):
    study = study_of(tmp_path, examples("how-to/describe-a-robot-of-several-joints.md")[0])
    assert [joint.name for joint in study.rig.joints] == ["shoulder", "elbow"]
    assert study.channels["position.elbow"].si_unit == "rad"


def test_the_example_of_a_robot_is_valid(tmp_path):
    study = study_of(tmp_path, examples("how-to/describe-a-robot-of-several-joints.md")[1])
    assert study.rig.joints[1].turns == {"shoulder": 30.0, "elbow": 30.0}
    assert study.rig.joints[0].place == (0.0, 0.0, 0.32)


def test_the_examples_of_several_instruments_are_valid(tmp_path):
    streams, joined, optical, _ = examples("how-to/join-files-of-several-instruments.md")
    study = study_of(tmp_path, MACHINE, CHANNELS, streams, joined, optical)
    assert study.streams["emg"].channels["emg.rectus_femoris"].si_unit == "V"
    assert study.recordings[0].streams == {"emg": "recordings/P1_swing_emg.csv"}
    assert list(study.joined_channels("drive")) == ["current"]
    assert study.recordings[1].offsets == {"drive": 0.3512}
    assert study.optical.markers == ("C", "R1", "R2", "R3")


def test_the_example_of_a_delay_is_valid(tmp_path):
    delayed = examples("how-to/join-files-of-several-instruments.md")[-1]
    study = study_of(tmp_path, MACHINE.replace("current", "torque"), delayed, RECORDING)
    assert study.channels["torque"].delay == 0.004


def tables_below(base: type) -> list[type]:
    return [each for table in base.__subclasses__() for each in (table, *tables_below(table))]


TABLES = [
    table
    for table in tables_below(study_fields.StudyTable)
    if table.__module__.startswith("pellucid.") and table not in (study_fields.ProcedureTable,)
]


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_every_key_is_explained_in_its_table(table):
    said = MADE["keys_of"](table)
    keys = [key for key, field in table.model_fields.items() if not field.validation_alias]
    assert [key for key in keys if len(said.get(key, "").split()) < 2] == []


def test_every_key_of_the_reference_is_explained():
    rows = [line for line in MADE["page"]("keys").splitlines() if line.startswith("| `")]
    assert len(rows) > 250
    assert [row for row in rows if row.endswith("|  |")] == []


def test_the_assessment_s_tutorial_is_a_valid_study(tmp_path):
    whole = next(lines for lines in examples("tutorials/assess-transparency.md") if "[[recordings]]" in lines)
    (tmp_path / "study.toml").write_text(whole, encoding="utf-8")
    study = open_study(tmp_path).config
    assert study.assessment.control == study.recordings[0].condition
    assert study.recordings[1].channels["interaction"].si_unit == "N*m"
    assert all(f"emg.{muscle}" in study.streams["emg"].channels for muscle in study.assessment.agonists)


def test_the_schema_for_editors_has_every_table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = DOCS / "how-to" / "write-a-study-toml.md"
    exec(
        compile(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)[-1], page.name, "exec"),
        {},
    )
    known = json.loads((tmp_path / "study.schema.json").read_text(encoding="utf-8"))["properties"]
    assert {"rig", "recordings", *(p.name for p in ALL_PROCEDURES if p.table is not None)} <= set(known)
