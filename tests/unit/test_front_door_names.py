"""Names, units and encodings of logs from labs of many languages, each of which was once read wrongly or refused."""

import json
import re

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.files.name_evidence import read_name
from pellucid.start.given_files import read_given
from pellucid.start.init_from_files import init_from_files, missing_part
from pellucid.start.propose_study import propose_study

INERTIA, GRAVITY, VISCOUS, COULOMB = 0.05, 2.0, 0.06, 0.2
LAG = 0.03  # a soft controller's lag [s]


def swing(seed=1, seconds=20.0, rate=100.0, late=0.0):
    """Return time [s], angle [rad] and torque [N*m] of a pendulum along a multisine, `late` [s], with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    q, v, a = (np.zeros(len(t)) for _ in range(3))
    for f, size, phase in zip((0.15, 0.37, 0.71, 1.3), (0.5, 0.3, 0.15, 0.06), rng.uniform(0.0, 6.0, 4), strict=True):
        w = 2.0 * np.pi * f
        q += size * np.sin(w * (t - late) + phase)
        v += size * w * np.cos(w * (t - late) + phase)
        a -= size * w**2 * np.sin(w * (t - late) + phase)
    tau = INERTIA * a + GRAVITY * np.sin(q) + VISCOUS * v + COULOMB * np.tanh(v / 0.01)
    return t, q, tau + 0.01 * rng.standard_normal(len(t))


def controlled(seed=1):
    """Return time [s], the angle that was asked for and the measured one [deg], and the torque [N*m]."""
    t, asked, _ = swing(seed)
    _, q, tau = swing(seed, late=LAG)
    noise = 0.01 * np.random.default_rng(seed + 1).standard_normal(len(t))
    return t, np.degrees(asked), np.degrees(q) + noise, tau


def written(path, header, columns, *, delimiter=",", encoding="utf-8"):
    body = "\n".join(delimiter.join(f"{x:.6g}" for x in row) for row in np.column_stack(columns))
    path.write_text(f"{header}\n{body}\n", encoding=encoding)
    return path


def proposed(*paths, **answers):
    return propose_study(read_given(paths), "study", answers)


def roles_of(proposal):
    return {r.column: r.quantity for layout in (proposal.main, *proposal.streams) for r in layout.channels}


@pytest.mark.parametrize(
    "name",
    [
        "Sollwinkel [°]", "Drehmoment_Soll", "Winkelsollwert", "指令角度", "目标位置(°)", "목표각도",
        "Limited Position", "Torque Setpoint", "Consigne couple", "Coppia riferimento", "Posición consigna",
    ],
)  # fmt: skip
def test_words_of_many_languages_tell_a_command(name):
    assert read_name(name).is_command


@pytest.mark.parametrize("name", ["Istwinkel", "反馈角度", "실측각도", "Actual Motor Position", "Couple mesuré"])
def test_words_of_many_languages_tell_a_measurement(name):
    assert read_name(name).is_measured
    assert not read_name(name).is_command


@pytest.mark.parametrize("name", ["resolution", "wrist_angle", "console_angle", "twist", "solid_angle"])
def test_words_that_only_begin_or_end_like_others_tell_neither(name):
    assert not read_name(name).is_command
    assert not read_name(name).is_measured


@pytest.mark.parametrize(
    ("asked", "measured"),
    [("Sollwinkel [°]", "Istwinkel [°]"), ("指令角度(°)", "反馈角度(°)"), ("목표각도(도)", "현재각도(도)"),
     ("Limited Position (deg)", "Position (deg)"), ("angle_a [deg]", "angle_b [deg]")],
)  # fmt: skip
@pytest.mark.parametrize("is_first", [True, False])
def test_the_angle_that_was_asked_for_is_not_the_joints(tmp_path, asked, measured, is_first):
    t, reference, q, tau = controlled()
    pair = [(asked, reference), (measured, q)]
    (a, x), (b, y) = pair if is_first else pair[::-1]
    path = written(tmp_path / "log.csv", f"time [s],{a},{b},torque [Nm]", [t, x, y, tau])
    found = roles_of(proposed(path))
    assert (found[asked], found[measured]) == ("reference", "position")


def test_a_filtered_copy_of_an_angle_is_no_command(tmp_path):
    t, _, q, tau = controlled()
    smooth = np.convolve(q, np.ones(9) / 9.0)[: len(q)]
    path = written(tmp_path / "log.csv", "time [s],angle_a [deg],angle_b [deg],torque [Nm]", [t, q, smooth, tau])
    assert "reference" not in roles_of(proposed(path)).values()


def test_two_joints_that_move_one_after_the_other_stay_joints(tmp_path):
    t, first, second, tau = controlled()
    names = "time [s],left_angle [deg],right_angle [deg],left_torque [Nm],right_torque [Nm]"
    path = written(tmp_path / "log.csv", names, [t, first, second, tau, 1.1 * tau])
    assert "reference" not in roles_of(proposed(path)).values()


@pytest.mark.parametrize(
    ("angle", "effort"),
    [("knee_flexion/position", "knee_flexion/effort"), ("Knee Flexion Angle (deg)", "Exo Knee Torque (Nm)"),
     ("position.elbow_flexion", "effort.elbow_flexion"), ("lumbar_flexion [deg]", "lumbar_torque [Nm]")],
)  # fmt: skip
def test_a_robots_joint_may_be_called_flexion(tmp_path, angle, effort):
    t, _, q, tau = controlled()
    path = written(tmp_path / "log.csv", f"timestamp,{angle},{effort}", [t, q, tau])
    found = proposed(path)
    assert missing_part(found) is None
    assert (roles_of(found)[angle], roles_of(found)[effort]) == ("position", "torque")


@pytest.mark.parametrize("effort", ["interaction_torque_Nm", "actuator_torque_Nm"])
def test_emg_beside_a_machines_effort_is_of_its_wearer(tmp_path, effort):
    t, _, q, tau = controlled()
    emg = 0.05 * np.abs(np.random.default_rng(0).standard_normal(len(t)))
    names = "time_s,elbow_flexion_deg,elbow_torque_Nm,emg_biceps_mV"
    path = written(tmp_path / "log.csv", f"{names},{effort}", [t, q, tau, emg, 0.3 * tau])
    found = proposed(path, worn="yes")
    assert found.drive == "torque"
    assert found.is_worn


def test_moments_of_several_joints_are_a_persons(tmp_path):
    t, _, q, tau = controlled()
    names = "time,hip_flexion,knee_angle,hip_flexion_moment,knee_angle_moment"
    path = written(tmp_path / "gait.csv", names, [t, q, 0.8 * q, 9.0 * tau, 11.0 * tau])
    assert "EMG" in missing_part(proposed(path))


def test_emg_with_a_force_and_no_angle_is_a_study_of_muscles_alone(tmp_path):
    t, _, _, tau = controlled()
    emg = np.random.default_rng(0).standard_normal((2, len(t)))
    path = written(tmp_path / "pull.csv", "time_s,force_N,emg_biceps_mV,emg_triceps_mV", [t, 20.0 + tau, *emg])
    found = proposed(path)
    assert missing_part(found) is None
    assert any("forces and other inputs are excluded" in remark for remark in found.remarks)


def test_a_further_position_in_counts_passes_the_check(tmp_path):
    t, _, q, tau = controlled()
    counts = np.round(8000.0 / 360.0 * q)
    names = "time_s,Position [counts],Second position [counts],Torque [Nm]"
    path = written(tmp_path / "log.csv", names, [t, counts, counts + 5.0, tau])
    made = init_from_files(tmp_path / "study", [path], answers={"counts_per_turn": "8000"})
    assert made.text.count('unit = "counts"') == 1


@pytest.mark.parametrize("unit", ["cnt", "LU", "increments"])
def test_words_of_drives_for_counts_are_known(tmp_path, unit):
    t, _, q, tau = controlled()
    path = written(tmp_path / "log.csv", f"time_s,Position [{unit}],Torque [Nm]", [t, np.round(100.0 * q), tau])
    found = proposed(path, counts_per_turn="36000")
    assert "counts_per_turn" in {question.key for question in found.asked}


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_the_advised_answer_to_an_unknown_unit_is_taken(tmp_path, scale):
    t, _, q, tau = controlled()
    path = written(tmp_path / "log.csv", "time_s,Position [foo],Torque [Nm]", [t, np.round(scale * q), tau])
    with pytest.raises(PellucidError, match="position_unit") as refusal:
        init_from_files(tmp_path / "refused", [path])
    key = re.search(r"--answer (\w+)=", str(refusal.value))[1]
    init_from_files(tmp_path / "study", [path], answers={key: "deg" if scale == 1.0 else "counts"})


def test_counts_that_the_lab_says_are_asked_for_their_turn(tmp_path):
    t, _, q, tau = controlled()
    path = written(tmp_path / "log.csv", "time_s,Position [foo],Torque [Nm]", [t, np.round(1000.0 * q), tau])
    found = proposed(path, position_unit="counts")
    assert "counts_per_turn" in {question.key for question in found.asked}


def test_the_advised_unit_of_an_angle_is_taken(tmp_path):
    t, _, q, tau = controlled()
    speed = np.gradient(np.radians(q), t)
    path = written(tmp_path / "log.csv", "time [s],angle [rad],velocity [rad/s],torque [Nm]", [t, q, speed, tau])
    with pytest.raises(PellucidError, match='position_unit=deg"'):
        init_from_files(tmp_path / "refused", [path])
    init_from_files(tmp_path / "study", [path], answers={"position_unit": "deg"})


@pytest.mark.parametrize(
    ("encoding", "header"),
    [
        ("gb18030", "时间(s),期望角度(°),实际角度(°),关节力矩(N·m)"),
        ("cp949", "시간(s),목표각도(도),관절각도(도),토크(Nm)"),
        ("euc_kr", "시간(s),목표각도(도),관절각도(도),토크(Nm)"),
        ("cp932", "時刻[s],指令角度[deg],現在角度[deg],トルク[Nm]"),
        ("euc_jp", "時刻[s],指令角度[deg],現在角度[deg],トルク[Nm]"),
        ("big5", "時間(s),目標角度(度),實際角度(度),轉矩(Nm)"),
        ("cp1251", "время [с],заданный угол [°],измеренный угол [°],момент [Н·м]"),
        ("latin-1", "Zeit [s],Sollwinkel [°],Istwinkel [°],Drehmoment für Hüfte [Nm]"),
        ("latin-1", "temps (s),angle consigne (°),angle mesuré (°),couple (N·m)"),
    ],
)
def test_headers_in_encodings_of_many_countries(tmp_path, encoding, header):
    t, reference, q, tau = controlled()
    path = written(tmp_path / "log.csv", header, [t, reference, q, tau], encoding=encoding)
    found = proposed(path)
    names = header.split(",")
    wanted = dict(zip(names[1:], ("reference", "position", "torque"), strict=True))
    assert {name: roles_of(found).get(name) for name in wanted} == wanted
    assert found.main.roles.clock.column == names[0]


def test_topics_by_turns_with_a_stamp_each_share_a_clock(tmp_path):
    t, _, q, tau = controlled()
    rows = []
    for time, angle, torque in zip(1000.0 * t, q, tau, strict=True):
        for late, name, value, unit in ((0, "position", angle, "deg"), (1, "torque", torque, "Nm")):
            payload = {"value": float(value), "unit": unit}
            rows.append({"topic": f"exo/elbow/{name}", "ts": round(1.7e12 + time) + late, "payload": payload})
    path = tmp_path / "mqtt.jsonl"
    path.write_text("\n".join(map(json.dumps, rows)))
    found = proposed(path)
    assert roles_of(found) == {"exo/elbow/position": "position", "exo/elbow/torque": "torque"}
    assert [role.unit for role in found.main.channels] == ["deg", "N*m"]
    assert found.main.roles.rate == pytest.approx(100.0, rel=0.01)


@pytest.mark.parametrize("mark", [",", ";"])
def test_cells_may_hold_their_unit(tmp_path, mark):
    t, _, q, tau = controlled()
    rows = [f"{time:.2f} s{mark}{x:.4f} °{mark}{y:.4f} N·m" for time, x, y in zip(t, q, tau, strict=True)]
    path = tmp_path / "grafana.csv"
    head = mark.join(('"Time"', '"knee angle"', '"knee torque"'))
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    found = proposed(path)
    assert {r.column: (r.quantity, r.unit) for r in found.main.channels} == {
        "knee angle [°]": ("position", "deg"), "knee torque [N·m]": ("torque", "N*m"),
    }  # fmt: skip
