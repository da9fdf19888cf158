"""`pellucid audit`: one verdict for each channel of a log of which no study tells anything."""

import json
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from research.evidence._audit_logs import score_logs
from typer.testing import CliRunner

import pellucid as pl
from pellucid.cli import app
from pellucid.emg.study.emg_files import audit_emg
from pellucid.files.log import VERDICT_WORDS, LogFinding
from pellucid.files.quantity import joint_words, quantity_of
from pellucid.start.try_log import try_log
from pellucid.study.procedures.audit import find_verdicts
from pellucid.study.procedures.audit_page import audited_channels, first_channels, write_audit_page

RATE = 500.0
COUNT = 6000


def clean_log(seed: int = 3) -> dict[str, np.ndarray]:
    """A joint that follows a path under a torque loop: every sensor has noise of its own."""
    rng = np.random.default_rng(seed)
    t = np.arange(COUNT) / RATE
    path = 0.6 * np.sin(2.1 * t) + 0.25 * np.sin(5.3 * t + 1.0)
    q = path + 0.01 * np.sin(3.0 * t) + 2e-4 * rng.standard_normal(COUNT)
    v = np.gradient(path, t) + 0.02 * rng.standard_normal(COUNT)
    asked = 3.0 * np.sin(path) + 0.4 * np.tanh(20.0 * v) + 0.1 * np.gradient(v, t) * 0.02
    measured = asked + 0.15 * np.sin(9.0 * t + 0.4) + 0.08 * rng.standard_normal(COUNT)
    emg = np.abs(np.sin(1.7 * t)) * rng.standard_normal(COUNT) * 2e-4
    names = ("time [s]", "angle [rad]", "velocity [rad/s]", "torque_cmd [N*m]", "torque_meas [N*m]", "EMG biceps [V]")
    return dict(zip(names, (t, q, v, asked, measured, emg), strict=True))


def written(folder: Path, columns: dict[str, np.ndarray], name: str = "log.csv", head: str = "") -> Path:
    rows = np.column_stack(list(columns.values()))
    lines = [",".join(columns), *(",".join(f"{x:.9g}" for x in row) for row in rows)]
    path = folder / name
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def kinds(path: Path, channel: str) -> set[str]:
    found = pl.audit(path)
    return {f.kind for v in found.verdicts if v.channel == channel for _, f in v.findings if f.level == "alarm"}


@pytest.mark.parametrize("seed", range(4))
def test_a_clean_log_has_no_alarm(tmp_path, seed):
    found = pl.audit(written(tmp_path, clean_log(seed)))
    assert found.is_sound, str(found)
    assert [v.verdict for v in found.verdicts] == ["sound"] * 6


def dies(x: np.ndarray) -> np.ndarray:
    return np.where(np.arange(COUNT) > 4000, x[4000], x)


FAULTS = {
    "dead from the start": ("torque_meas [N*m]", "dead", lambda x: 0.0 * x),
    "dies": ("torque_meas [N*m]", "dead", dies),
    "EMG dies": ("EMG biceps [V]", "dropout", dies),
    "last digit": ("torque_meas [N*m]", "dead", lambda x: 0.01 * (np.sin(np.arange(COUNT) ** 2.0) > 0.0)),
    "impossible": ("torque_meas [N*m]", "impossible", lambda x: np.where(np.arange(COUNT) == 77, 7.7e5, x)),
    "saturated": ("torque_cmd [N*m]", "saturated", lambda x: np.clip(x, -1.2, 1.2)),
    "clipped": ("EMG biceps [V]", "saturation", lambda x: np.clip(x, -2.5e-4, 2.5e-4)),
    "glitch": ("angle [rad]", "spike", lambda x: np.where(np.arange(COUNT) == 3000, x + 1.0, x)),
    "lost": ("angle [rad]", "missing_samples", lambda x: np.where(np.arange(COUNT) % 1000 < 20, np.nan, x)),
    "slow clock": ("velocity [rad/s]", "another_clock", lambda x: np.repeat(x[::5], 5)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_at_its_channel_and_nowhere_else(tmp_path, fault):
    channel, kind, spoil = FAULTS[fault]
    columns = clean_log()
    columns[channel] = spoil(columns[channel])
    found = pl.audit(written(tmp_path, columns))
    level = "repaired" if kind == "missing_samples" else "alarm"
    told = [v for v in found.verdicts if v.level in ("alarm", "repaired")]
    assert kind in {f.kind for v in told for _, f in v.findings if f.level == level}, str(found)
    assert {v.channel for v in told} == {channel}, str(found)


def test_a_measurement_that_is_its_own_command_is_an_echo(tmp_path):
    columns = clean_log()
    late = np.roll(columns["torque_cmd [N*m]"], 36)
    late[:36] = late[36]
    columns["torque_meas [N*m]"] = late
    found = pl.audit(written(tmp_path, columns))
    (verdict,) = found.alarms
    assert (verdict.channel, verdict.verdict) == ("torque_meas [N*m]", "echoed")
    assert "36 rows late" in verdict.sentences[0]


def test_rows_of_garbage_at_an_edge_are_one_finding(tmp_path):
    columns = clean_log()
    for name, x in columns.items():
        x[:7] = 1.125e282 if name != "time [s]" else [5e4, 4e4, 3e3, 1e3, 900.0, 80.0, 60.0]
        x[-2:] = -3e17 if name != "time [s]" else 0.0
    found = pl.audit(written(tmp_path, columns))
    (verdict,) = [v for v in found.verdicts if v.level != "sound"]
    assert (verdict.verdict, verdict.level) == ("garbage rows", "repaired")
    assert "first 7 and the last 2 of 6000 rows" in verdict.sentences[0], verdict.sentences


def test_packets_and_gaps_are_the_clock_s(tmp_path):
    columns = clean_log()
    kept = np.delete(np.arange(COUNT), slice(2000, 2300))
    columns = {name: x[kept] for name, x in columns.items()}
    # The log has EMG, of whose clock a gap is one of lost samples.
    assert kinds(written(tmp_path, columns), "time [s]") == {"clock"}
    bursts = clean_log()
    bursts["time [s]"] = np.ceil(bursts["time [s]"] * RATE / 8.0) * 8.0 / RATE + 1e-5 * np.tile(
        np.arange(8), COUNT // 8
    )
    assert kinds(written(tmp_path, bursts), "time [s]") == {"uneven"}


def test_a_log_without_time_asks_for_its_rate(tmp_path):
    columns = clean_log()
    del columns["time [s]"]
    path = written(tmp_path, columns)
    assert [v.verdict for v in pl.audit(path).alarms] == ["no time base"]
    assert pl.audit(path, rate=RATE).is_sound


def test_a_log_of_motion_alone_is_not_followed_by_a_study(tmp_path):
    """The next command, `init`, ended with status 1."""
    columns = {name: column for name, column in clean_log().items() if name in ("time [s]", "angle [rad]")}
    assert len(columns) == 2
    answer = pl.audit(written(tmp_path, columns)).answer
    assert (answer.verdict, answer.next_command) == ("yes", "")
    assert "Record an effort" in answer.following[0]


def test_sound_channels_are_counted_and_constant_ones_are_named(tmp_path):
    """The answer was "No alarm in 29 channels", and a tile "usable, with care: 9"."""
    columns = clean_log()
    faults = {f"fault_{i}": np.zeros(COUNT) for i in range(3)}
    found = pl.audit(written(tmp_path, columns | faults))
    said = "6 of 9 channels of 1 file are sound; 3 constant (fault_0, fault_1, fault_2)."
    assert (found.answer.verdict, found.answer.said) == ("yes", said)
    text = write_audit_page(found, tmp_path / "page").read_text(encoding="utf-8")
    assert said in text
    assert "3 constant" in text.partition("with a note")[2][:200]


def test_the_figure_of_a_sound_log_draws_what_a_study_is_made_of(tmp_path):
    """A counter and two temperatures were drawn."""
    columns = clean_log()
    rng = np.random.default_rng(1)
    idle = {"seq": np.arange(COUNT), "temp_0": 30.0 + rng.standard_normal(COUNT), "fault": np.zeros(COUNT)}
    other = {"angle_motor [rad]": 9.0 * columns["angle [rad]"] + 1e-3 * rng.standard_normal(COUNT)}
    found = pl.audit(written(tmp_path, idle | other | columns))
    shown = [axis.get_title(loc="left") or axis.texts[0].get_text() for axis in first_channels(found).figure.axes]
    assert shown == ["angle_motor [rad]", "velocity [rad/s]", "torque_meas [N*m]"]


def test_personal_fields_are_named_and_not_repeated(tmp_path):
    path = written(tmp_path, clean_log(), head="Patient Name,Jane Q. Doe\n")
    found = pl.audit(path)
    assert [v.verdict for v in found.alarms] == ["personal"]
    assert "Doe" not in json.dumps(found.table())
    assert "Doe" not in write_audit_page(found, tmp_path / "page").read_text(encoding="utf-8")


def test_the_command_says_it_and_ends_with_status_0_because_no_is_an_answer(tmp_path, monkeypatch):
    columns = clean_log()
    path = written(tmp_path, columns)
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["audit", str(path)])
    assert done.exit_code == 0, done.output
    assert "6 of 6 channels of 1 file are sound." in done.output
    assert (tmp_path / "audit-page" / "index.html").is_file()
    columns["torque_meas [N*m]"] *= 0.0
    path = written(tmp_path, columns)
    done = CliRunner().invoke(app, ["audit", str(path), "--json", "--out", str(tmp_path / "page")])
    assert done.exit_code == 0, done.output
    table = json.loads(done.stdout)
    assert (table["answer"]["verdict"], table["sound"]) == ("no", False)
    assert {v["channel"]: v["verdict"] for v in table["verdicts"]}["torque_meas [N*m]"] == "dead"


def test_without_a_file_that_can_be_read_it_is_refused(tmp_path):
    with pytest.raises(pl.PellucidError, match="no file that can be read"):
        pl.audit(tmp_path)
    (tmp_path / "a.csv").write_text("words\n", encoding="utf-8")
    with pytest.raises(pl.PellucidError, match="no row of numbers"):
        pl.audit(tmp_path / "a.csv")


def test_an_exosuit_s_log_comes_out_as_its_readme_says(data_folder):
    folder = data_folder / "elbow_exosuit"
    if not folder.is_dir():
        pytest.skip("elbow_exosuit is not here")
    found = pl.audit(folder)
    verdicts = {v.channel: v for v in found.verdicts}
    assert len(found.files) == 24
    assert not found.unread
    assert verdicts["time"].verdict == "no time base"
    feedback = verdicts["Feedback_Torque_Nm"]
    assert feedback.verdict == "impossible values"
    assert "every file of emg_threshold, in none of preplanned_threshold: up to 7.373e+05" in feedback.sentences[0]
    applied = verdicts["Applied_Torque_Nm"]
    assert applied.verdict == "saturated"
    assert applied.sentences[0].startswith("in all 24 files: cut at 4.1 and -4.1 N*m")
    assert any("no torque is measured" in sentence for sentence in applied.sentences)
    assert "down to -100 N*m/rad" in verdicts["K_value_Nm_per_rad"].sentences[0]


@pytest.mark.parametrize(
    ("name", "kind", "role", "unit"),
    [
        ("Applied_Torque_Nm", "torque", "command", "N*m"),
        ("B_value_Nm_per_rad_per_s", "damping", "", "N*m*s/rad"),
        ("Position_Error_rad", "position", "computed", "rad"),
        ("Motor Current (mA)", "current", "", "A"),
        ("GoalPosition", "position", "command", ""),
        ("EMG_VL_mV", "emg", "", "V"),
        ("t [ms]", "time", "", "s"),
        ("torque_enable", "enabled", "", ""),
        ("L1_T12_Lat_Bending", "", "", ""),
        ("0", "", "", ""),
    ],
)
def test_a_column_s_name_tells_its_quantity(name, kind, role, unit):
    found = quantity_of(name)
    assert (found.kind, found.role, found.unit) == (kind, role, unit)


def test_channels_of_one_joint_share_their_words():
    assert joint_words("knee_torque_cmd") == joint_words("knee angle [deg]") == "knee"
    assert joint_words("q1") == joint_words("tau_1")


def test_drawn_logs_with_sealed_faults_are_found_and_sound_ones_are_left_alone():
    """The evidence counts two hundred; these few are of neither the seeds that set thresholds nor those judged."""
    score = score_logs(range(500, 508))
    assert sum(score.faulty.values()) >= 4
    assert sum(score.found.values()) == sum(score.faulty.values()), score.said
    assert (score.false_alarms, score.misplaced) == (0, 0), score.said


def wide_table(folder, channels, rows=400):
    """Write torques of which one is a copy and one the sum of two others; the rest have nothing in common."""
    rng = np.random.default_rng(8)
    table = np.cumsum(rng.standard_normal((rows, channels)), axis=0)
    table[:, 3] = table[:, channels - 1]
    table[:, 5] = np.clip(table[:, channels // 2] + table[:, 1], *np.quantile(table[:, 1], (0.1, 0.9)))
    names = ["t [s]", *(f"torque{i} [N*m]" for i in range(channels))]
    path = folder / f"wide{channels}.csv"
    rows = np.column_stack([0.01 * np.arange(rows), table])
    np.savetxt(path, rows, "%.7g", ",", header=",".join(names), comments="")
    return path


def test_sums_and_copies_are_found_among_hundreds_of_channels(tmp_path):
    found = {v.channel: str(v.sentences) for v in pl.audit(wide_table(tmp_path, 900)).verdicts if v.sentences}
    assert "equals torque899" in found["torque3 [N*m]"]
    assert "equals torque1 [N*m] plus torque450" in found["torque5 [N*m]"]
    assert len([text for text in found.values() if "equals" in text]) == 2


def test_a_wide_log_takes_time_in_proportion_to_its_channels(tmp_path):
    began = process_time()
    pl.audit(wide_table(tmp_path, 150))
    narrow = process_time() - began
    began = process_time()
    pl.audit(wide_table(tmp_path, 900))
    # Pairs of 900 channels are 36 times those of 150.
    assert process_time() - began < 18.0 * narrow


def test_a_file_of_few_rows_says_so(tmp_path):
    path = tmp_path / "short.sto"
    path.write_text("name\nnRows=2\nnColumns=2\nendheader\ntime\tx\n0\t1\n1\t2\n")
    verdicts = {v.channel: (v.verdict, v.level) for v in pl.audit(path).verdicts}
    assert verdicts == {"time": ("too short", "note"), "x": ("sound", "sound")}


def test_notes_on_the_file_stay_beside_a_clock_with_gaps(tmp_path):
    columns = clean_log()
    kept = np.delete(np.arange(COUNT), slice(2000, 2300))
    path = written(tmp_path, {name: x[kept] for name, x in columns.items()})
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*lines[:900], "12.0,broken", *lines[900:]]) + "\n", encoding="utf-8")
    (clock,) = [v for v in pl.audit(path).verdicts if v.channel == "time [s]"]
    assert {f.kind for _, f in clock.findings} == {"clock", "damaged_rows"}


def test_a_signal_that_is_switched_is_sound_and_a_flickering_one_is_dead(tmp_path):
    """A square wave of 0 and 5 N was called dead, and should have been recorded again."""
    columns = clean_log()
    columns["pulses_N"] = np.where(np.arange(COUNT) % 2000 < 900, 5.0, 0.0)
    columns["load [N]"] = np.repeat([0.0, 2.0, 9.0, 10.0, 0.0, 2.0], COUNT // 6)
    found = pl.audit(written(tmp_path, columns))
    assert found.is_sound, str(found)
    pulses, load = found.verdicts[-2:]
    assert (pulses.verdict, pulses.level) == ("sound", "sound")
    assert "switched signal or marker: 0 and 5 N" in pulses.sentences[0]
    assert "0, 2, 9 and 10 N" in load.sentences[0]
    columns["pulses_N"] = np.where(np.random.default_rng(1).random(COUNT) > 0.5, 5.0, 0.0)
    assert [v.verdict for v in pl.audit(written(tmp_path, columns)).alarms] == ["dead"]


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("torque_limit [N*m]", 12.0, "a setting"),
        ("max_current [A]", 8.0, "a setting"),
        ("operating mode", 3.0, "a setting"),
        ("motor temperature [degC]", 35.0, "a setting, or not connected"),
        ("Present_Voltage [V]", 12.1, "a supply voltage"),
    ],
)
def test_a_setting_that_never_changes_is_constant_and_not_dead(tmp_path, name, value, why):
    columns = clean_log() | {name: np.full(COUNT, value)}
    found = pl.audit(written(tmp_path, columns))
    assert found.is_sound, str(found)
    assert (found.verdicts[-1].verdict, found.verdicts[-1].level) == ("constant", "note")
    assert why in found.verdicts[-1].sentences[0]


@pytest.mark.parametrize("name", ["angle [rad]", "torque_meas [N*m]", "velocity [rad/s]"])
def test_a_measured_channel_that_never_changes_is_dead(tmp_path, name):
    columns = clean_log()
    columns[name] = np.full(COUNT, 0.5)
    assert [v.verdict for v in pl.audit(written(tmp_path, columns)).alarms] == ["dead"]


def test_a_joint_that_rests_beside_one_that_moves_is_not_dead(tmp_path):
    columns = clean_log()
    columns |= {f"gripper {name}": np.full(COUNT, 0.2) for name in ("angle [rad]", "velocity [rad/s]", "torque [N*m]")}
    found = pl.audit(written(tmp_path, columns))
    assert found.is_sound, str(found)
    assert "at rest, or not connected" in found.verdicts[-1].sentences[0]


def test_what_reading_repairs_is_no_reason_to_record_again(tmp_path):
    """`try` left out the repeated packets and said yes, and the audit left out the clock."""
    columns = clean_log()
    rows = np.sort(np.append(np.arange(COUNT), np.random.default_rng(2).choice(COUNT, 150, replace=False)))
    columns = {name: x[rows] for name, x in columns.items() if "EMG" not in name}
    columns["angle [rad]"][3000:3003] = np.nan
    path = written(tmp_path, columns)
    found = pl.audit(path)
    assert found.is_sound, str(found)
    clock, angle = found.verdicts[:2]
    assert (clock.verdict, clock.level) == ("repeated packets", "repaired")
    assert "150 repeated packets" in clock.sentences[0]
    assert (angle.verdict, angle.level) == ("missing samples", "repaired")
    repaired = "time [s] (repeated packets), angle [rad] (missing samples)"
    assert f"Pellucid repairs {repaired} when it reads the log" in found.headline
    assert found.answer.badge == "Yes (after automatic repair)"
    assert found.answer.basis.sentence == (
        f"Based on 1 file, {COUNT + 150:,} rows, 150 repeated rows excluded, measured or simulated (not stated)."
    )
    assert found.answer.next_command.startswith("pellucid init my-study --from")
    columns["angle [rad]"][1000:5000] = np.nan
    assert [v.verdict for v in pl.audit(written(tmp_path, columns)).alarms] == ["missing samples"]


def test_a_clock_that_starts_again_is_joined_as_by_reading(tmp_path):
    columns = clean_log()
    del columns["EMG biceps [V]"]
    ticks = (np.round(1e3 * columns.pop("time [s]")) + 60_000) % 65_536
    found = pl.audit(written(tmp_path, {"tick_ms": ticks, **columns}))
    assert found.is_sound, str(found)
    assert "starts again after 65.536 s" in found.verdicts[0].sentences[0]


def test_a_file_that_describes_the_recordings_is_not_audited(tmp_path):
    written(tmp_path, clean_log())
    for name in ("ORIGINAL_README.txt", "LICENSE.txt", "readme-first.txt"):
        (tmp_path / name).write_text("1 2 3\nsome words about it\n", encoding="utf-8")
    assert [file.name for file in pl.audit(tmp_path).files] == ["log.csv"]


def test_an_audit_names_alike_channels_in_one_step_and_asks_for_a_rate(tmp_path):
    log = clean_log()
    del log["time [s]"]
    for name in ("angle [rad]", "torque_meas [N*m]"):
        log[name] = 0.0 * log[name]
    path = written(tmp_path, log)
    steps = pl.audit(path).answer.following
    assert steps == (
        "Give the rate of files without a column of time by `--rate HZ`.",
        "Record or compute again the channels that never change: angle [rad], torque_meas [N*m] (dead).",
        f"Then audit changed files again: `pellucid audit {path}`.",
    )


def test_dead_channels_beside_sound_ones_lead_to_a_study_of_the_others(tmp_path):
    """It advised to exclude them from a study that did not exist, and to audit again, which said no again."""
    log = clean_log()
    log["velocity [rad/s]"] = 0.0 * log["velocity [rad/s]"]
    paths = [written(tmp_path, log, f"{i}.csv") for i in range(2)]
    found = pl.audit(paths)
    assert found.headline == "1 of 6 channels is unsound: velocity [rad/s] (dead: in all files)."
    assert found.answer.following == (
        "Record or compute again the channels that never change: velocity [rad/s] (dead).",
        "Or use the other 5 channels (`init` excludes those that never change): "
        f"`pellucid init my-study --from {paths[0]} {paths[1]}`.",
    )


def test_a_step_names_the_file_of_a_fault_whatever_the_file_is_called(tmp_path):
    """A file named "all motions.csv" read as all files."""
    log = clean_log()
    sound = written(tmp_path, log, "other.csv")
    log["velocity [rad/s]"] = 0.0 * log["velocity [rad/s]"]
    found = pl.audit([written(tmp_path, log, "all motions.csv"), sound])
    assert "velocity [rad/s] in all motions.csv (dead)" in found.answer.next[0].text


def test_unsound_channels_are_grouped_by_fault_and_file(tmp_path):
    """A fault of one file read as one of all files, and exchanged channels had no partner."""
    rng, paths = np.random.default_rng(7), []
    t = np.arange(COUNT) / RATE
    for i in range(3):
        # Three electrodes, each with the same place in every file
        source = [np.abs(np.sin((1.3 + k) * t)) * rng.standard_normal(COUNT) * 1e-4 for k in range(2)]
        columns = {"time [s]": t, "EMG a [V]": source[0], "EMG b [V]": source[1]}
        columns["EMG c [V]"] = 1e-5 + np.abs(rng.standard_normal(COUNT)) * 1e-4
        if i == 1:
            columns["EMG b [V]"] = columns["EMG b [V]"] + 3e-4 * np.sin(2.0 * np.pi * 50.0 * t)
        paths.append(written(tmp_path, columns, f"{i}.csv"))
    found = audit_emg(paths)
    assert found.headline == (
        "2 of 3 channels are unsound: EMG b [V] (mains hum: in 1.csv); "
        "EMG c [V] (envelope, not raw EMG: in all files)."
    )
    assert "Record again, or exclude from the study: EMG b [V] in 1.csv (mains hum)" in [
        step.text for step in found.answer.next
    ]
    swapped = [
        replace(
            file,
            findings=tuple(
                LogFinding("exchanged", f"EMG {one} [V]", "", partner=f"EMG {other} [V]")
                for one, other in ("ab", "ba")
                if file.name == "2.csv"
            ),
        )
        for file in found.files
    ]
    found = replace(found, files=tuple(swapped), verdicts=tuple(find_verdicts(swapped)))
    assert found.headline.endswith("EMG a [V], EMG b [V] (exchanged with each other: in 2.csv).")
    assert found.answer.next[0].text == "Exchange the names EMG a [V], EMG b [V] in 2.csv"


def test_the_quality_of_a_study_is_based_on_what_it_states(tmp_path):
    """It said "not stated" of a study that states it, and no again of envelopes that the study states."""
    columns = {name: x for name, x in clean_log().items() if "time" in name or "EMG" in name}
    columns["EMG c [V]"] = 1e-5 + np.abs(columns["EMG biceps [V]"])
    written(tmp_path, columns)
    text = (
        'name = "s"\nsimulated = false\n[rig]\njoint = "elbow"\nmotion = "rotary"\nlifts = "flexion"\n'
        '[participants.P1]\n[channels]\ntime = { column = "time", unit = "s" }\n'
        'emg.biceps = { column = "EMG biceps", unit = "V" }\nemg.c = { column = "EMG c", unit = "V" }\n[onset]\n'
        '[[recordings]]\nname = "r"\nfile = "log.csv"\nparticipant = "P1"\n'
    )
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    found = audit_emg([tmp_path])
    assert not found.is_sound
    assert found.answer.basis.sentence == f"Based on 1 file of 1 person, {COUNT:,} rows, measured."
    stated = text.replace('"EMG c", unit = "V"', '"EMG c", unit = "1"')
    (tmp_path / "study.toml").write_text(stated, encoding="utf-8")
    found = audit_emg([tmp_path])
    assert found.is_sound, str(found)
    assert found.answer.next_command == f"pellucid check {tmp_path}"


def test_an_audit_tells_its_progress_file_by_file(tmp_path):
    paths = [written(tmp_path, clean_log(seed), f"log{seed}.csv") for seed in range(2)]
    told = []
    pl.audit(paths, on_progress=lambda text, share: told.append((text, share)))
    assert [text for text, _ in told] == ["checking log0.csv", "checking log1.csv", "writing the page"]
    shares = [share for _, share in told]
    assert shares[0] == 0.0 < shares[1] < shares[2] < 1.0


def test_the_figure_of_an_unsound_channel_is_of_a_file_with_its_verdict(tmp_path):
    """A finding of another kind was larger, and its file was drawn under a verdict that it does not have."""
    dead, cut = clean_log(0), clean_log(1)
    dead["torque_meas [N*m]"] = 0.0 * dead["torque_meas [N*m]"]
    cut["torque_meas [N*m]"] = np.clip(cut["torque_meas [N*m]"], -1.0, 1.0)
    found = pl.audit([written(tmp_path, dead, "dead.csv"), written(tmp_path, cut, "cut.csv")])
    (torque,) = [each for each in found.alarms if each.channel == "torque_meas [N*m]"]
    assert {name for name, _ in torque.findings} == {"dead.csv", "cut.csv"}
    for verdict, name, _, _ in audited_channels(found):
        assert verdict.verdict in {VERDICT_WORDS[f.kind] for file, f in verdict.findings if file == name}


def test_a_basis_counts_what_reading_excludes(tmp_path):
    """Rows that were excluded, and gaps, were named by neither the audit nor the answer of the fit."""
    t = np.arange(0.0, 40.0, 0.01)
    q = 0.5 * np.sin(2 * np.pi * 0.31 * t) + 0.3 * np.sin(2 * np.pi * 0.73 * t + 1.0)
    speed = np.gradient(q, t)
    torque = 0.05 * np.gradient(speed, t) + 2.0 * np.sin(q) + 0.1 * speed + 0.3 * np.tanh(speed / 0.01)
    torque += 0.01 * np.random.default_rng(3).standard_normal(t.size)
    rows = np.sort(np.append(np.arange(t.size), np.arange(100, t.size, 80)))
    rows = rows[~((rows >= 1000) & (rows < 1060)) & ~((rows >= 3000) & (rows < 3040))]
    repeats = rows.size - np.unique(rows).size
    path = written(tmp_path, {"t [s]": t[rows], "angle [rad]": q[rows], "torque [N*m]": torque[rows]})
    words = f"{rows.size:,} rows, {repeats} repeated rows excluded, 2 gaps of up to 0.61 s cut"
    assert words in pl.audit(path).answer.basis.sentence
    assert words in try_log([path], out=tmp_path / "out").answer.basis.sentence


def test_the_audit_of_emg_counts_the_files_that_have_emg(tmp_path):
    """It was based on all nine files of a study of which three have EMG."""
    log = clean_log()
    without = {name: samples for name, samples in log.items() if "EMG" not in name}
    found = audit_emg([written(tmp_path, log, "emg.csv"), written(tmp_path, without, "motion.csv")])
    assert [file.name for file in found.files] == ["emg.csv"]
    assert found.answer.basis.sentence == f"Based on 1 file, {COUNT:,} rows, measured or simulated (not stated)."


def test_a_channel_is_shown_in_the_unit_that_its_file_states():
    """An angle in degrees was listed as "position [rad]"."""
    found = quantity_of("knee_angle [deg]")
    assert (found.unit, found.stated) == ("rad", "deg")
    assert quantity_of("emg_soleus").stated == ""


def test_the_table_of_an_audit_has_the_files_units(tmp_path):
    columns = clean_log()
    columns["angle [deg]"] = np.degrees(columns.pop("angle [rad]"))
    held = {v.channel: v.holds for v in pl.audit(written(tmp_path, columns)).verdicts}
    assert held["angle [deg]"] == "position [deg]"
    assert held["torque_meas [N*m]"] == "torque, measured [N·m]"
