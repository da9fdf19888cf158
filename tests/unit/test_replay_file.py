"""`pellucid live DIR --replay FILE` computes a session again, and holds any other log against the supervisor."""

import numpy as np
import pytest
from test_live_replay import CONDITIONS, played
from typer.testing import CliRunner

from pellucid._errors import PellucidError
from pellucid.cli import app
from pellucid.files.xdf_writer import XdfWriter
from pellucid.live.replay import RAW_COLUMNS, raw_values
from pellucid.live.session.recorded_trial import replay_file
from pellucid.live.setup import DeviceNumbers, EngineSetup, settings_text
from pellucid.study.procedures.registry import open_study

STUDY = """
name = "logs"
[rig]
joint = "elbow"
motion = "rotary"
lifts = "flexion"
[rig.drive]
kind = "torque"
[rig.limits]
effort = "5 N*m"
velocity = "8 rad/s"
position_min = "-0.5 rad"
position_max = "2.6 rad"
[channels]
time = {time}
position = {{ column = "angle", unit = "deg" }}
torque = {{ column = "asked", unit = "N*m" }}
[[recordings]]
name = "a"
file = "a.csv"
"""
CLOCK = '{ column = "t", unit = "s" }'


def log_study(folder, angle, torque, time=CLOCK):
    folder.mkdir(exist_ok=True)
    (folder / "study.toml").write_text(STUDY.format(time=time), encoding="utf-8")
    t = 0.005 * np.arange(len(angle))
    table = np.column_stack([t, np.rad2deg(angle), torque])
    np.savetxt(folder / "a.csv", table, delimiter=",", header="t,angle,asked", comments="")
    return open_study(folder)


def moved(count=400):
    t = 0.005 * np.arange(count)
    return 0.8 + 0.3 * np.sin(2.0 * t), np.cos(2.0 * t)


def session_file(path, records):
    writer = XdfWriter(path)
    setup = EngineSetup(tuple(CONDITIONS), DeviceNumbers("udp", "127.0.0.1:5005"))
    columns = [(name, "") for name in RAW_COLUMNS]
    writer.add_stream(1, "engine", "Engine", columns, description={"settings": settings_text(setup)})
    writer.write_samples(1, 1e-3 * np.arange(len(records)), raw_values(records))
    writer.seal()
    return path


def test_a_healthy_log_is_not_stopped_and_its_energy_is_told(tmp_path):
    study = log_study(tmp_path / "s", *moved())
    answer = replay_file(study, tmp_path / "s" / "a.csv")
    assert answer.is_equal
    assert "channel torque against position" in answer.lines[0]
    assert "5 N*m, 300 N*m/s, 8 rad/s and -0.5 to 2.6 rad." in answer.lines[0]
    assert "At 200 Hz, the supervisor would not have stopped any of the 400 samples" in answer.lines[1]
    assert "J to the person in the whole log" in answer.lines[1]


def test_a_log_that_lies_elsewhere_is_stopped_at_its_sample(tmp_path):
    study = log_study(tmp_path / "s", *moved())
    angle, torque = moved()
    angle[250:] += 1.5  # the encoder leaps
    log_study(tmp_path / "other", angle, torque)
    answer = replay_file(study, tmp_path / "other" / "a.csv")
    assert "would have stopped at sample 250 of 400" in answer.lines[1]
    assert "The stop is 1.250 s after the first sample." in answer.lines[1]


def test_a_log_without_a_clock_is_told_in_samples(tmp_path):
    angle, torque = moved()
    angle[250:] += 1.5
    study = log_study(tmp_path / "s", angle, torque, time='{ rate = "200 Hz" }')
    (line,) = replay_file(study, tmp_path / "s" / "a.csv").lines[1:]
    assert "At 200 Hz (assumed, because the log has no clock)" in line
    assert "sample 250 of 400" in line
    assert "after the first sample" not in line


def test_the_command_line_says_whether_every_bit_is_equal(tmp_path):
    log_study(tmp_path / "s", *moved())
    records = played()
    words = ["live", str(tmp_path / "s"), "--replay"]
    right = CliRunner().invoke(app, [*words, str(session_file(tmp_path / "a.xdf", records))])
    assert right.exit_code == 0, right.output
    assert "300 commands of 300 cycles" in right.output
    assert "All commands agree in every bit." in right.output
    records["effort"][200] = np.nextafter(records["effort"][200], 9.0)
    wrong = CliRunner().invoke(app, [*words, str(session_file(tmp_path / "b.xdf", records))])
    assert wrong.exit_code == 1
    assert "bits differ, the first in cycle 201." in wrong.output


def test_what_cannot_be_replayed_says_why(tmp_path):
    study = log_study(tmp_path / "s", *moved())
    with pytest.raises(PellucidError, match=r"no such file, expected a session's session\.xdf or a log"):
        replay_file(study, tmp_path / "nothing.csv")
    records = played(10)
    records["flags"] = 0
    path = session_file(tmp_path / "c.xdf", records)
    with pytest.raises(PellucidError, match="found 10 cycles without a controller"):
        replay_file(study, path)
    path = tmp_path / "s" / "study.toml"
    text = path.read_text(encoding="utf-8").replace("torque = {", "current = {").replace('"N*m" }\n[[', '"A" }\n[[')
    path.write_text(text.replace('kind = "torque"', 'kind = "current"\ntorque_constant = "1 N*m/A"'), encoding="utf-8")
    study = open_study(tmp_path / "s")
    with pytest.raises(PellucidError, match=r"a\.csv: found the channels .*current.*, expected command or torque"):
        replay_file(study, tmp_path / "s" / "a.csv")
