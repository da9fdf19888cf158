"""Layouts, units and defects of logs that labs write, each of which was once read wrongly or refused."""

import numpy as np
import pytest

import pellucid as pl
from pellucid.files.defects.garbage import zeroed_rows
from pellucid.files.log import inspect_log, log_of
from pellucid.files.readers import Columns, read_columns
from pellucid.files.recording import LOCKED_SPRING_PROTOCOL
from pellucid.joint.fit.recording_agreement import RecordingRows, _compare, estimate_step
from pellucid.start.given_files import read_given, tables_of_columns
from pellucid.start.init_from_files import missing_part
from pellucid.start.proposal_page import proposal_page
from pellucid.start.propose_study import propose_study, require_signed_effort
from pellucid.start.study_text import channel_name, study_text
from pellucid.start.try_log import try_log

INERTIA, GRAVITY, VISCOUS, COULOMB = 0.05, 2.0, 0.06, 0.2


def swing(seed=1, seconds=20.0, rate=200.0):
    """Return time [s], angle [rad], velocity and torque [N*m] of a pendulum along a multisine, with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    q, v, a = (np.zeros(len(t)) for _ in range(3))
    for f, size, phase in zip((0.15, 0.37, 0.71, 1.3), (0.5, 0.3, 0.15, 0.06), rng.uniform(0.0, 6.0, 4), strict=True):
        w = 2.0 * np.pi * f
        q += size * np.sin(w * t + phase)
        v += size * w * np.cos(w * t + phase)
        a -= size * w**2 * np.sin(w * t + phase)
    tau = INERTIA * a + GRAVITY * np.sin(q) + VISCOUS * v + COULOMB * np.tanh(v / 0.01)
    return t, q + 2e-4 * rng.standard_normal(len(t)), v, tau + 0.01 * rng.standard_normal(len(t))


def written(path, header, columns, *, delimiter=",", above=""):
    body = "\n".join(delimiter.join(f"{x:.6g}" for x in row) for row in np.column_stack(columns))
    path.write_text(f"{above}{header}\n{body}\n", encoding="utf-8")
    return path


def proposed(*paths, **answers):
    return propose_study(read_given(paths), "study", answers)


def roles_of(proposal):
    return {r.column: (r.quantity, r.unit) for layout in (proposal.main, *proposal.streams) for r in layout.channels}


@pytest.mark.parametrize("still", ["roll_deg", "trunk_angle_deg"])
def test_an_angle_of_something_else_is_no_locked_end(tmp_path, still):
    t, q, v, _ = swing()
    noise = 5.0 + 0.05 * np.random.default_rng(0).standard_normal(len(t))
    # With little friction, the weight follows the angle as a spring does.
    tau = 0.15 * np.gradient(v, t) + 4.0 * np.sin(q) + 0.1 * v + 0.1 * np.tanh(v / 0.01)
    path = written(tmp_path / "log.csv", f"time_s,pitch_deg,{still},torque_Nm",
                   [t, np.degrees(q), noise, tau])  # fmt: skip
    assert not any(recording.protocol == LOCKED_SPRING_PROTOCOL for recording in proposed(path).recordings)


def test_the_name_of_a_project_is_no_person(tmp_path):
    t, q, _, tau = swing()
    names = ("Axis_Hip.ActPos", "Axis_Hip.ActTorque")
    above = "\n".join([
        "Name\tScope Project", "File\tC:\\TwinCAT\\hip.svdx", "", "\t".join(f"Name\t{name}" for name in names),
        "Unit\t°\tUnit\t‰", "SampleTime [ms]\t5\tSampleTime [ms]\t5", "", "",
    ])  # fmt: skip
    head = "\t".join(f"Time [ms]\t{name}" for name in names)
    columns = [1e3 * t, np.degrees(q), 1e3 * t, 100.0 * tau]
    found = proposed(written(tmp_path / "scope.csv", head, columns, delimiter="\t", above=above))
    assert found.drive is not None
    assert "rated" in {question.key for question in found.asked}
    assert found.main.tables[0].personal == ()


def test_the_moment_of_one_joint_is_a_torque(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "ankle.csv", "time [s],ankle_angle [deg],ankle_moment [Nm]", [t, np.degrees(q), tau])
    found = proposed(path)
    assert missing_part(found) is None
    assert roles_of(found)["ankle_moment [Nm]"] == ("torque", "N*m")


def test_a_groups_t_is_its_clock(tmp_path):
    h5py = pytest.importorskip("h5py")
    t, q, _, tau = swing()
    path = tmp_path / "session.h5"
    with h5py.File(path, "w") as file:
        for group, name, x, unit in (("encoder", "angle", q, "rad"), ("torque_sensor", "value", tau, "N.m")):
            file[f"{group}/t"] = 1.7e9 + t
            file[f"{group}/{name}"] = x
            file[f"{group}/{name}"].attrs["unit"] = unit
    found = proposed(path)
    assert "rate" not in {question.key for question in found.asked}
    assert "torque_sensor.t" not in roles_of(found)


def test_a_file_named_after_a_devices_id_tells_no_inverse_dynamics(tmp_path):
    t, q, v, tau = swing()
    path = written(tmp_path / "can0_id01.csv", "stamp;p;v;t", [1.7e9 + t, q, v, tau], delimiter=";")
    text = path.read_text().splitlines()
    rows = [f"{1.7e9 + s:.4f};{';'.join(row.split(';')[1:])}" for s, row in zip(t, text[1:], strict=True)]
    path.write_text("\n".join([text[0], *rows]) + "\n")
    found = roles_of(proposed(path))
    assert (found["p"][0], found["v"][0], found["t"][0]) == ("position", "velocity", "torque")


def test_the_voltage_of_a_valve_is_no_drive(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "pam.csv", "time_s,angle_deg,pressure_bar,valve_V",
                   [t, np.degrees(q), 2.5 + 0.2 * tau, 5.0 + 0.3 * tau])  # fmt: skip
    assert "no effort was recorded" in missing_part(proposed(path))


def test_emg_beside_an_effort_without_an_angle_is_not_called_an_envelope(data_folder):
    """Four raw channels beside a dynamometer were "only the envelopes of 4 muscles", of which 3 were wanted."""
    path = data_folder / "elderly_isometric" / "ID 1.xlsx"
    if not path.is_file():
        pytest.skip("elderly_isometric is not here")
    said = missing_part(proposed(path))
    assert said is not None
    assert "no joint angle" in said
    assert "envelope" not in said


def test_an_angle_and_envelopes_without_a_torque_ask_for_the_torque(tmp_path):
    t, q, *_ = swing()
    envelopes = [0.1 + 0.1 * np.sin(2.0 * np.pi * f * t) ** 2 for f in (0.5, 0.7)]
    header = "time [s],knee_angle [deg],vastus_lateralis [1],biceps_femoris [1]"
    said = missing_part(proposed(written(tmp_path / "trial.csv", header, [t, np.degrees(q), *envelopes])))
    assert said.startswith("found a joint angle and the envelopes of 2 muscles, but no torque")
    assert "knee_torque" in said


def test_a_muscle_that_one_file_lacks_stays_a_muscle_of_the_others(tmp_path):
    t, q, _, tau = swing()
    envelopes = [0.1 + 0.1 * np.sin(2.0 * np.pi * f * t) ** 2 for f in (0.5, 0.7)]
    header = "time [s],knee_angle [deg],vastus_lateralis [1],knee_torque [N*m],biceps_femoris [1]"
    columns = [t, np.degrees(q), envelopes[0], tau, envelopes[1]]
    whole = written(tmp_path / "whole.csv", header, columns)
    less = written(tmp_path / "less.csv", header.rpartition(",")[0], columns[:-1])
    extras = {r.name: [channel_name(role) for role in r.extras] for r in proposed(whole, less).recordings}
    assert extras == {"whole": ["emg.biceps_femoris"], "less": []}


def test_emg_beside_an_unnamed_torque_says_how_a_study_of_torque_from_emg_is_made(tmp_path):
    t, q, _, tau = swing()
    envelopes = [0.1 + 0.1 * np.sin(2.0 * np.pi * f * t) ** 2 for f in (0.5, 0.7)]
    short = proposed(written(tmp_path / "short.csv", "t,q,vl,bf,tau", [t, np.degrees(q), *envelopes, tau]))
    assert any('"knee_torque [N*m]"' in text for text in short.remarks)
    header = "t,knee_angle [deg],vl,bf,knee_torque [N*m]"
    named = proposed(written(tmp_path / "named.csv", header, [t, np.degrees(q), *envelopes, tau]))
    assert named.is_person
    assert not any("knee_torque" in text for text in named.remarks)


def test_a_command_alone_is_asked_for(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", "t_s,q_rad,tau_cmd_Nm", [t, q, tau])
    assert "command_followed" in {question.key for question in proposed(path).asked}
    tried = try_log([path], out=tmp_path / "page")
    assert tried.answer.badge == "Yes (scale not confirmed)"
    assert try_log([path], out=tmp_path / "sure", answers={"command_followed": "yes"}).answer.verdict == "yes"


def test_a_measured_torque_beside_its_command_is_not_asked_for(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", "t_s,q_rad,tau_cmd_Nm,tau_Nm", [t, q, np.roll(tau, -2), tau])
    assert "command_followed" not in {question.key for question in proposed(path).asked}


def test_units_stated_above_the_table_count(tmp_path):
    t, q, _, tau = swing()
    above = '"Torque units","in-lb"\n"Angle units","deg"\n"Sample rate (Hz)",200\n\n'
    path = written(tmp_path / "run.csv", '"Sample","Angle","Torque"',
                   [np.arange(len(t)), np.degrees(q), tau / 0.1129848], above=above)  # fmt: skip
    found = proposed(path)
    assert roles_of(found) == {"Angle": ("position", "deg"), "Torque": ("torque", "inch*lbf")}
    assert "effort" not in {question.key for question in found.asked}


@pytest.mark.parametrize(
    ("answer", "factor"), [("torque in lbf*in", 0.1129848), ("torque in 2.4525 N*m", 2.4525), ("torque in mN*m", 1e-3)]
)
def test_an_answer_may_have_any_unit_and_the_size_of_a_number(tmp_path, answer, factor):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", "t_s,q_rad,load", [t, q, tau / factor])
    folder = pl.init(tmp_path / "study", files=[path], answers={"effort": answer})
    (first, *_) = pl.open(folder.folder if hasattr(folder, "folder") else tmp_path / "study").recordings()
    torque = next(channel for name, channel in first.channels.items() if name == "torque")
    assert np.ptp(torque.samples) == pytest.approx(np.ptp(tau[: len(torque.samples)]), rel=0.02)


def test_an_answer_in_another_unit_is_refused_with_an_example(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", "t_s,q_rad,load", [t, q, tau])
    with pytest.raises(pl.PellucidError, match=r"current in 2\.69 mA"):
        proposed(path, effort="torque in A")


def test_a_motor_beside_a_joint_is_before_a_gear(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "hip.csv", "time,motor_pos,joint_torque", [t, 50.0 * q, tau])
    found = proposed(path)
    assert roles_of(found)["motor_pos"][0] == "motor_position"
    assert {"gear_turns", "position_unit"} <= {question.key for question in found.asked}


def test_a_documented_motors_encoder_asks_for_the_gear(tmp_path):
    t, q, v, tau = swing()
    head = "timestamp,axis0.encoder.pos_estimate,axis0.encoder.vel_estimate,axis0.motor.current_control.Iq_measured"
    turns = 8.0 / (2.0 * np.pi)
    found = proposed(written(tmp_path / "odrive.csv", head, [t, turns * q, turns * v, tau / 0.44]))
    assert "gear_turns" in {question.key for question in found.asked}


def test_each_joint_may_have_a_drive_constant(tmp_path):
    (t, q1, _, tau1), (_, q2, _, tau2) = swing(1), swing(2)
    path = written(tmp_path / "arm.csv", "t_s,q1_rad,q2_rad,i1_A,i2_A", [t, q1, q2, tau1 / 9.0, tau2 / 2.0])
    pl.init(tmp_path / "study", files=[path], answers={"drive_constant": "9, 2 N*m/A"})
    first = pl.open(tmp_path / "study").recordings()[0]
    torques = [channel for name, channel in first.channels.items() if name.startswith("torque")]
    for channel, tau in zip(torques, (tau1, tau2), strict=True):
        assert np.ptp(channel.samples) == pytest.approx(np.ptp(tau[: len(channel.samples)]), rel=0.02)
    with pytest.raises(pl.PellucidError, match="found 3 numbers"):
        proposed(path, drive_constant="9, 2, 1 N*m/A")


def test_an_effort_without_its_sign_is_refused(tmp_path):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", "t_s,q_rad,motor_torque_Nm", [t, q, np.abs(tau)])
    with pytest.raises(pl.PellucidError, match="needs an effort of both signs"):
        require_signed_effort(proposed(path))
    require_signed_effort(proposed(written(tmp_path / "signed.csv", "t_s,q_rad,motor_torque_Nm", [t, q, tau])))
    # A joint that only ever lifts has an effort of one sign.
    lifting = written(tmp_path / "lifting.csv", "t_s,q_rad,motor_torque_Nm", [t, 1.6 + 0.5 * q, 4.0 + 0.5 * tau])
    require_signed_effort(proposed(lifting))


def test_packets_of_zeros_are_left_out(tmp_path):
    t, q, _, tau = swing(seconds=30.0)
    lost = np.random.default_rng(5).uniform(size=len(t)) < 0.015
    lost[[0, -1]] = False
    degrees = np.where(lost, 0.0, 25.0 + np.degrees(q))
    path = written(tmp_path / "udp.csv", "seq,time_ms,knee_deg,knee_Nm",
                   [np.arange(len(t)), 1e3 * t, degrees, np.where(lost, 0.0, tau)])  # fmt: skip
    assert any("packets without data" in finding.found for finding in inspect_log(log_of(read_columns(path))))
    found = try_log([path], out=tmp_path / "page")
    gravity = {p.name: p.value for p in found.joints[0].parameters}
    assert np.hypot(gravity["gravity"], gravity["gravity_cosine"]) == pytest.approx(GRAVITY, rel=0.03)
    assert found.answer.verdict == "yes"


def test_packets_of_zeros_are_left_out_of_every_recording_of_a_file(tmp_path):
    values = {}
    for trial in ("trial_1", "trial_2"):
        t, q, _, tau = swing(seconds=10.0)
        lost = np.arange(len(t)) % 97 == 50
        own = {"t": t, "q": np.where(lost, 0.0, 1.0 + q), "tau": np.where(lost, 0.0, tau)}
        values |= {f"{trial}.{name}": x for name, x in own.items()}
    tables = tables_of_columns(Columns(tmp_path / "all.npz", values, recordings=("trial_1", "trial_2")))
    assert [table.rows for table in tables] == [2000 - int(lost.sum())] * 2


def test_zeros_of_a_machine_at_rest_are_no_lost_packets():
    n = np.arange(2000)
    q = np.where((n // 200) % 2 == 0, 0.0, np.sin(0.05 * n))
    assert not zeroed_rows({"q": q, "tau": np.where(q == 0.0, 0.0, 2.0 * q), "n": n.astype(float)}).any()


def test_tables_below_each_other_are_recordings(tmp_path):
    parts = []
    for run in (1, 2, 3):
        t, q, _, tau = swing(run, seconds=8.0)
        rows = "\n".join(f"{a:.3f},{np.degrees(b):.4f},{c:.5f}" for a, b, c in zip(t, q, tau, strict=True))
        parts.append(f"Run {run}\nTime (s),Position (deg),Torque (Nm)\n{rows}\n\n")
    path = tmp_path / "all.csv"
    path.write_text("".join(parts))
    columns = read_columns(path)
    assert columns.recordings == ("run_1", "run_2", "run_3")
    assert {len(x) for x in columns.values.values()} == {1600}
    assert len(proposed(path).recordings) == 3


@pytest.mark.parametrize(
    "row",
    [
        "t_ms: {0:.0f}  angle: {1:.2f}  torque: {2:.4f}",
        "t_ms:{0:.0f},angle:{1:.2f},torque:{2:.4f}",
        "t_ms={0:.0f}; angle={1:.2f} deg; torque={2:.4f} Nm",
    ],
)
def test_rows_with_labels_are_a_table(tmp_path, row):
    t, q, _, tau = swing(seconds=10.0)
    path = tmp_path / "putty.txt"
    banner = "=~=~=~=~=~= PuTTY log 2024.03.02 14:02:11 =~=~=~=~=~=\nHX711 init... tare done\nReady\n"
    rows = (row.format(*each) for each in zip(1e3 * t, np.degrees(q), tau, strict=True))
    path.write_text(banner + "\n".join(rows) + "\n")
    columns = read_columns(path)
    assert [name.split(" ")[0] for name in columns.names] == ["t_ms", "angle", "torque"]
    assert np.allclose(columns[2], tau, atol=1e-4)


def test_speeds_of_one_sign_first_and_the_other_later_are_split_by_turns(tmp_path):
    rate = 100.0
    levels = np.concatenate([np.linspace(0.5, 4.0, 8), -np.linspace(0.5, 4.0, 8)])
    v = np.repeat(levels, round(4.0 * rate))
    t = np.arange(len(v)) / rate
    tau = 0.06 * v + 0.3 * np.sign(v) + 0.005 * np.random.default_rng(0).standard_normal(len(v))
    columns = [t, np.cumsum(v) / rate, v, tau]
    path = written(tmp_path / "friction.csv", "time_s,angle_rad,speed_rad_s,torque_Nm", columns)
    uses = [recording.use for recording in proposed(path).recordings]
    assert uses.count("validate") >= 2


def rows_of(name, frequencies, inertia, gravity, seed):
    """Return regression rows about (0.05, 2.0) of a recording along sines, whose body is another one."""
    t = np.arange(0.0, 20.0, 0.01)
    w = 2.0 * np.pi * np.array(frequencies)[:, None]
    q, a = np.sum(0.3 * np.sin(w * t), axis=0), np.sum(-0.3 * w**2 * np.sin(w * t), axis=0)
    columns = np.column_stack([a, np.sin(q), np.gradient(q, t)])
    noise = 0.01 * np.random.default_rng(seed).standard_normal(len(t))
    effort = columns @ np.array([inertia, gravity, 0.06]) + noise
    return RecordingRows(name, "fitted", columns, effort - columns @ np.array([0.05, 2.0, 0.06]), effort, [len(t)])


def test_a_recording_that_cannot_tell_inertia_from_weight_may_contradict_the_others():
    """Along one sine the acceleration follows the angle: what they make together is known, and is enough."""
    names, values = ("inertia", "gravity", "viscous"), np.array([0.05, 2.0, 0.06])
    others = [rows_of(f"rich_{k}", (0.2, 0.7, 1.3), 0.05, 2.0, k) for k in (1, 2)]
    loaded = rows_of("loaded", (0.5,), 0.09, 3.4, 3)
    assert estimate_step([loaded]) is None
    found = _compare(loaded, others, names, values)
    assert found is not None
    assert set(found[1].own) & {"inertia", "gravity"}
    assert _compare(rows_of("alike", (0.5,), 0.05, 2.0, 4), others, names, values) is None


@pytest.mark.parametrize(
    ("answers", "effort", "badge"),
    [
        ({}, "torque_Nm", "Yes (with assumptions)"),
        ({"worn": "no", "angle_zero": "yes"}, "torque_Nm", "Yes"),
        ({}, "torque_raw", "Yes (scale not confirmed)"),
    ],
)  # fmt: skip
def test_a_proposals_page_says_whether_it_rests_on_assumptions(tmp_path, answers, effort, badge):
    t, q, _, tau = swing()
    path = written(tmp_path / "log.csv", f"time_s,angle_rad,{effort}", [t, q, tau])
    answer = proposal_page(propose_study(read_given([path]), "study", answers), tmp_path).answer
    assert answer.badge == badge
    assert bool(answer.assumed) == (not answers)


def test_a_force_plate_beside_a_log_is_no_part_of_its_joint(tmp_path):
    t, q, _, tau = swing()
    exo = written(tmp_path / "exo.csv", "time_s,hip_angle_deg,motor_torque_Nm", [t, np.degrees(q), tau])
    late = np.arange(0.0, 20.0, 1e-3)
    load = 800.0 * np.clip(np.sin(5.6 * late), 0.0, None)
    names = "Time,FP1_Fx,FP1_Fy,FP1_Fz,FP1_Mx,FP1_My,FP1_Mz"
    plate = written(
        tmp_path / "treadmill.csv", names, [late, 0.1 * load, 0.2 * load, load, 0.1 * load, 0.3 * load, load]
    )
    found = proposed(exo, plate)
    assert roles_of(found)["FP1_Fx"][0] == "force"
    text = study_text(found, {id(table): table.path.name for table in (*found.main.tables, *found.given.tables)})
    assert "join = true" not in text
