"""An effort that says nothing is refused in words, and one that merely looks plain is not."""

import sys

import numpy as np
import pytest
from made_arm import arm_study

import pellucid as pl
from pellucid._errors import PellucidError, RecordingError
from pellucid.cli import main

SECOND = """
[[recordings]]
name = "again"
file = "recordings/again.csv"
use = "fit"
"""


def refused(study):
    return [(fault.kind, fault.channel) for fault in pl.check(study) if fault.severity == "refuse"]


def cut_efforts(study):
    """Return the channels of efforts that were cut out because they are silent while the joint moves."""
    return [cut.channel for cut in study.recording("sweep").cuts if cut.kind == "dead_effort"]


def toggling(level, step, seed=5):
    """A constant that a converter reads as one or the other of two neighbouring digits."""
    return level + step * np.random.default_rng(seed).integers(0, 2, 2000)


@pytest.mark.parametrize(
    "dead",
    [
        np.zeros(2000),
        np.full(2000, 3.2),
        np.where(np.arange(2000) % 2, 0.1 + 0.2, 0.3),
        toggling(0.0, 0.01),
        toggling(-0.01, 0.02) * (np.arange(2000) % 3 > 0),
        toggling(5.0, 0.005),
    ],
    ids=["zero", "constant", "rounding", "last_digit", "three_levels", "offset_and_digit"],
)
def test_a_dead_effort_is_refused_by_check_and_by_identify(make_study, dead):
    study = make_study(make_study.swing() | {"i": dead})
    assert refused(study) == [("dead_effort", "current")]
    with pytest.raises(RecordingError, match=r"sweep.csv, channel current: found (the one value|only the values)"):
        pl.identify(study)


def test_a_negative_zero_is_told_as_0(make_study):
    """A dead sensor whose sign is turned has the one value -0."""
    study = make_study(make_study.swing() | {"i": np.full(2000, -0.0)})
    assert [fault.found for fault in pl.check(study) if fault.severity == "refuse"] == [
        "the one value 0 A in every sample of all fitted recordings"
    ]


@pytest.mark.parametrize(
    ("kind", "channel", "unit"),
    [("torque", "torque", "N*m"), ("voltage", "voltage", "V"), ("voltage", "duty", "1")],
)
def test_every_kind_of_effort_is_looked_at_and_named(make_study, kind, channel, unit):
    supply = 'supply = "12 V"\n' if channel == "duty" else ""
    study = make_study(
        make_study.swing() | {"i": np.zeros(2000)},
        ('kind = "current"\ntorque_constant = "2 N*m/A"', f'kind = "{kind}"\n{supply}'),
        ('current = { column = "i", unit = "A" }', f'{channel} = {{ column = "i", unit = "{unit}" }}'),
    )
    assert refused(study) == [("dead_effort", channel)]


def test_the_force_of_a_slide(make_study):
    columns = make_study.swing() | {"i": np.zeros(2000)}
    study = make_study(
        columns,
        ('motion = "rotary"\nlifts = "flexion"', 'motion = "prismatic"'),
        ('kind = "current"\ntorque_constant = "2 N*m/A"', 'kind = "torque"'),
        ('position = { column = "q", unit = "rad" }', 'position = { column = "q", unit = "m" }'),
        ('current = { column = "i", unit = "A" }', 'force = { column = "i", unit = "N" }'),
    )
    assert refused(study) == [("dead_effort", "force")]


@pytest.mark.parametrize("column", ["q", "t", "v"])
def test_a_copy_of_time_or_motion_is_no_effort(make_study, column):
    columns = make_study.swing()
    columns["v"] = np.gradient(columns["q"], columns["t"])
    drive = 'current = { column = "i", unit = "A" }'
    velocity = 'velocity = { column = "v", unit = "rad/s" }'
    for copied in (drive.replace('"i"', f'"{column}"'), drive.replace('"i", unit = "A"', f'"{column}", unit = "mA"')):
        study = make_study(columns, (drive, f"{velocity}\n{copied}"))
        assert refused(study) == [("copied_effort", "current")]
    study = make_study(columns | {"i": columns[column]}, (drive, f"{velocity}\n{drive}"))
    assert refused(study) == [("copied_effort", "current")]


def test_a_supply_that_reads_zero_makes_a_dead_effort(make_study):
    columns = make_study.swing()
    study = make_study(
        columns | {"i": np.clip(columns["i"] / 5, -1, 1), "s": np.zeros(2000)},
        ('kind = "current"\ntorque_constant = "2 N*m/A"', 'kind = "voltage"'),
        (
            'current = { column = "i", unit = "A" }',
            'duty = { column = "i", unit = "1" }\nsupply = { column = "s", unit = "V" }',
        ),
    )
    assert refused(study) == [("dead_effort", "duty")]


def test_an_effort_in_proportion_to_position_may_be_a_spring(make_study):
    columns = make_study.swing()
    assert ("copied_effort", "current") not in refused(make_study(columns | {"i": -3.0 * columns["q"]}))


def with_second(make_study, effort, use="fit"):
    """A study of two recordings, the second of which has another effort."""
    columns = make_study.swing()
    study = make_study(columns, append=SECOND.replace('use = "fit"', f'use = "{use}"'))
    rows = zip(columns["t"].tolist(), (-columns["q"]).tolist(), effort, strict=True)
    lines = ["t,q,i", *(",".join(map(repr, row)) for row in rows)]
    (study.folder / "recordings" / "again.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return pl.open(study.folder)


def test_one_recording_with_a_constant_effort_beside_others_is_told_and_used(make_study):
    study = with_second(make_study, [0.0] * 2000)
    assert refused(study) == []
    assert [(f.severity, f.file) for f in pl.check(study) if f.kind == "dead_effort"] == [("note", "again.csv")]


def test_held_out_recordings_with_a_dead_effort_judge_nothing(make_study):
    study = with_second(make_study, [0.0] * 2000, use="validate")
    assert refused(study) == [("dead_effort", "current")]
    with pytest.raises(RecordingError, match="all held-out recordings"):
        pl.identify(study)


def driven_by_a_relay(levels):
    """A damped joint of 0.05 kg m^2 without weight under an effort that switches between two or three values [A]."""
    dt, n = 0.005, 4000
    t = np.arange(n) * dt
    q, v, current = np.zeros(n), 0.0, np.zeros(n)
    mid = len(levels) // 2
    for k in range(1, n):
        phase = np.sin(2 * np.pi * 0.7 * t[k]) + 0.6 * np.sin(2 * np.pi * 1.9 * t[k])
        current[k] = levels[-1] if phase > 0.4 else levels[0] if phase < -0.4 or len(levels) == 2 else levels[mid]
        for _ in range(5):
            v += dt / 5 * (2.0 * current[k] - 0.4 * v - 4.0 * np.sin(q[k - 1])) / 0.05
            q[k] = q[k - 1] = q[k - 1] + dt / 5 * v
    return {"t": t, "q": q, "i": current}


@pytest.mark.parametrize("levels", [(-0.8, 0.8), (0.0, 0.8), (-0.5, 0.0, 0.5)])
def test_a_drive_that_switches_between_two_or_three_values_is_alive(make_study, levels):
    assert refused(make_study(driven_by_a_relay(levels))) == []


def test_an_effort_that_is_constant_for_a_while_is_alive(make_study):
    columns = make_study.swing()
    study = make_study(columns | {"i": np.where(columns["t"] < 3.0, 0.0, columns["i"])})
    assert ("dead_effort", "current") not in refused(study)


def breakaway(jump=0.0, digit=0.0, moves_before=0.0):
    """A joint that sticks under a rising current and slides once the current holds its last value."""
    t = np.arange(2000) / 200.0
    current = np.minimum(t / 5.0, 1.0) * 1.2
    current[1000:] += jump
    q = np.where(t > 4.5, 0.05 * np.clip(t - 4.5, 0, None) ** 2, 0.0) + moves_before * np.sin(3.0 * t)
    return {"t": t, "q": q, "i": np.round(current / digit) * digit if digit else current}


@pytest.mark.parametrize("digit", [0.0, 0.01])
def test_a_ramp_to_breakaway_that_holds_its_value_is_alive(make_study, digit):
    assert cut_efforts(make_study(breakaway(digit=digit))) == []


@pytest.mark.parametrize("made", [{"jump": -1.2}, {"moves_before": 0.3}], ids=["falls_to_zero", "moves_before"])
def test_a_ramp_after_which_a_sensor_dies_is_dead(make_study, made):
    assert cut_efforts(make_study(breakaway(**made))) == ["current"]


@pytest.mark.parametrize("effort", [0.0, 3.2])
def test_a_joint_that_never_moves_is_refused_in_words(make_study, effort):
    columns = make_study.swing()
    still = {"t": columns["t"], "q": np.full(2000, 0.3), "i": np.full(2000, effort)}
    assert refused(make_study(still))
    with pytest.raises(PellucidError):
        pl.identify(make_study(still))


def test_arrays_with_no_effort_are_refused_in_words(make_study):
    columns = make_study.swing()
    with pytest.raises(PellucidError, match=r"found the one value 0 N\*m in every sample"):
        pl.fit_joint(columns["t"], columns["q"], np.zeros(2000), lowpass=20.0)


@pytest.mark.parametrize("command", ["check", "identify"])
def test_the_command_line_refuses_with_status_1(make_study, command, monkeypatch, capsys):
    study = make_study(make_study.swing() | {"i": np.zeros(2000)})
    monkeypatch.setattr(sys, "argv", ["pellucid", command, str(study.folder)])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 1
    assert "channel current" in "".join(capsys.readouterr())


def test_a_joint_of_a_robot_with_a_dead_effort_is_named(tmp_path):
    folder = arm_study(tmp_path / "arm")
    for path in sorted((folder / "recordings").glob("*.csv")):
        header, *lines = path.read_text(encoding="utf-8").splitlines()
        column = header.split(",").index("u2")
        rows = [line.split(",") for line in lines]
        rows = [[*row[:column], "0.0", *row[column + 1 :]] for row in rows]
        path.write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n", encoding="utf-8")
    study = pl.open(folder)
    channels = {channel for kind, channel in refused(study) if kind == "dead_effort"}
    assert len(channels) == 1
    assert channels.pop().endswith(".elbow")
    with pytest.raises(RecordingError, match=r"channel (torque|current)\.elbow: found the one value 0"):
        pl.identify(study)
