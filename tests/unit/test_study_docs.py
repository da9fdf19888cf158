"""docs/study-file.md says what is true of study.toml."""

import json
import re
from pathlib import Path

import pytest

from pellucid.controllers.study.rig_instruments import rig_instruments
from pellucid.study import instruments_table, study_file
from pellucid.study.procedures.registry import ALL_PROCEDURES, open_study

PAGE = Path(__file__).parents[2] / "docs" / "study-file.md"
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
TABLES = [
    study_file.StudyFile,
    study_file.AssumedDefault,
    study_file.OneJoint,
    study_file.RigJoint,
    study_file.Body,
    study_file.Drive,
    study_file.Loop,
    study_file.JointLimits,
    study_file.Slider,
    instruments_table.InstrumentsTable,
    instruments_table.DriveSensor,
    instruments_table.ForceSensor,
    study_file.Participant,
    study_file.Subtracted,
    study_file.ChannelSpec,
    study_file.Optical,
    study_file.Stream,
    *(p.table for p in ALL_PROCEDURES if p.table is not None),
    study_file.Processing,
    study_file.Model,
    study_file.PayloadSpec,
    study_file.RecordingEntry,
    instruments_table.SessionTable,
    instruments_table.SessionLimits,
    instruments_table.PointingTask,
    instruments_table.TrackingTask,
    instruments_table.HoldingTask,
    instruments_table.ContractionTask,
]


def test_the_example_is_valid(tmp_path):
    example, *_ = EXAMPLES
    (tmp_path / "study.toml").write_text(example, encoding="utf-8")
    study = open_study(tmp_path).config
    assert study.name == "my-elbow"
    assert study.channels["position"].si_unit == "rad"
    assert len(study.recordings) == 3


def test_the_example_of_several_joints_is_valid(tmp_path):
    (tmp_path / "study.toml").write_text(f'name = "arm"\n{EXAMPLES[1]}', encoding="utf-8")
    study = open_study(tmp_path).config
    assert [joint.name for joint in study.rig.joints] == ["shoulder", "elbow"]
    assert study.channels["position.elbow"].si_unit == "rad"


def test_the_example_of_instruments_is_valid(tmp_path):
    """It stands apart from the whole example, whose drive it measures."""
    head, channels = EXAMPLES[0].split("[channels]")
    (tmp_path / "study.toml").write_text(f"{head}{EXAMPLES[2]}[channels]{channels}", encoding="utf-8")
    found = rig_instruments(open_study(tmp_path).config.rig)
    assert (found.drive, found.drive_offset, found.force_range, found.start_up_answer) == (True, 0.1, 25.0, 0.014)
    assert found.drive_limit == pytest.approx(0.06 * 28.0 * 8.0)


def test_the_slider_s_examples_are_valid(tmp_path):
    """They stand apart from the whole example, which has no slider: put into it."""
    example, _, _, rail, _, _, optical, *_ = EXAMPLES
    head, channels = example.split("[channels]")
    (tmp_path / "study.toml").write_text(f"{head}{rail}[channels]{channels}{optical}", encoding="utf-8")
    study = open_study(tmp_path).config
    assert study.rig.slider.marker in study.optical.markers
    assert [r.slider for r in study.recordings] == [None] * 4 + [0.152]


def test_the_streams_example_is_valid(tmp_path):
    """It stands apart from the whole example, whose channels it goes with."""
    example, streams = EXAMPLES[0], EXAMPLES[4]
    (tmp_path / "study.toml").write_text(f"{example}\n{streams}", encoding="utf-8")
    study = open_study(tmp_path).config
    assert study.streams["emg"].channels["emg.rectus_femoris"].si_unit == "V"
    assert study.recordings[-1].streams == {"emg": "recordings/P1_swing_emg.csv"}


def test_the_example_of_a_joined_stream_is_valid(tmp_path):
    """So does this one."""
    (tmp_path / "study.toml").write_text(f"{EXAMPLES[0]}\n{EXAMPLES[5]}", encoding="utf-8")
    study = open_study(tmp_path).config
    assert list(study.joined_channels("drive")) == ["current"]
    assert study.recordings[-1].offsets == {"drive": 0.3512}


def test_the_example_of_a_robot_is_valid(tmp_path):
    robot = next(text for text in EXAMPLES if "[tree]" in text)
    (tmp_path / "study.toml").write_text(robot, encoding="utf-8")
    study = open_study(tmp_path).config
    assert study.rig.joints[1].turns == {"shoulder": 30.0, "elbow": 30.0}
    assert study.rig.joints[0].place == (0.0, 0.0, 0.32)
    assert study.recordings[1].payload.mass == 2.8


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_every_key_is_explained(table):
    page = PAGE.read_text(encoding="utf-8")
    keys = [key for key, field in table.model_fields.items() if not field.validation_alias]
    absent = [key for key in keys if not re.search(rf"[`\[.\s]{key}[`\].\s]", page)]
    assert absent == []


def test_the_assessment_s_tutorial_is_a_valid_study(tmp_path):
    page = (PAGE.parent / "tutorials" / "assess-transparency.md").read_text(encoding="utf-8")
    whole = next(lines for lines in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "[[recordings]]" in lines)
    (tmp_path / "study.toml").write_text(whole, encoding="utf-8")
    study = open_study(tmp_path).config
    assert study.assessment.control == study.recordings[0].condition
    assert study.recordings[1].channels["interaction"].si_unit == "N*m"
    assert all(f"emg.{muscle}" in study.streams["emg"].channels for muscle in study.assessment.agonists)


def test_the_schema_for_editors_has_every_table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(
        compile(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[-1], PAGE.name, "exec"),
        {},
    )
    known = json.loads((tmp_path / "study.schema.json").read_text(encoding="utf-8"))["properties"]
    assert {"rig", "recordings", *(p.name for p in ALL_PROCEDURES if p.table is not None)} <= set(known)
