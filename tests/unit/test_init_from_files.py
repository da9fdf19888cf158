"""`init --from`: own files become a study, with a mark for each guess and at most five questions."""

import re
import tomllib
from dataclasses import replace

import made_layouts
import numpy as np
import pytest
from typer.testing import CliRunner

import pellucid as pl
from pellucid._errors import UnfitRecordingError
from pellucid.cli import app
from pellucid.files.name_evidence import read_name
from pellucid.files.stated_units import split_unit
from pellucid.start.given_files import read_given
from pellucid.start.inference.angle_units import find_angle_unit, find_unsigned_bits
from pellucid.start.inference.assign_roles import TableHints, assign_roles
from pellucid.start.inference.clocks import find_clock
from pellucid.start.inference.emg_spectrum import find_flat_shape, is_raw_emg
from pellucid.start.inference.motion_efforts import (
    FULL_TURNS,
    find_derivatives,
    find_repeated_motion,
    motion_samples,
    weigh_turns,
)
from pellucid.start.proposal import MAX_QUESTION_COUNT
from pellucid.start.propose_study import propose_study
from pellucid.start.study_text import study_text
from pellucid.units import to_si_factor


def proposed(layout):
    """Return the proposal of a made layout and its study.toml."""
    proposal = propose_study(read_given(layout.files), "made")
    tables = [t for r in proposal.recordings for t in (r.table, *r.streams.values())]
    return proposal, study_text(proposal, {id(table): f"recordings/{table.path.name}" for table in tables})


def written_urdf(path, joints):
    """Write a chain of links that turn."""
    links = "".join(
        f'<link name="l{i}"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
        '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for i in range(joints + 1)
    )
    hinges = "".join(
        f'<joint name="hinge_{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<origin xyz="0.3 0 0"/><axis xyz="0 1 0"/></joint>'
        for i in range(joints)
    )
    path.write_text(f'<robot name="arm">{links}{hinges}</robot>')
    return path


def channels_of(table, prefix=""):
    for key, value in table.items():
        if {"column", "rate"} & set(value):
            yield f"{prefix}{key}", value
        else:
            yield from channels_of(value, f"{prefix}{key}.")


@pytest.mark.parametrize("make", made_layouts.LAYOUTS, ids=lambda make: make.__name__)
def test_a_made_layout_is_understood_without_a_hand_on_study_toml(tmp_path, make):
    layout = make(tmp_path)
    proposal, text = proposed(layout)
    study = tomllib.loads(text)
    tables = [study["channels"], *(stream["channels"] for stream in study.get("streams", {}).values())]
    found = [(name, entry) for table in tables for name, entry in channels_of(table)]
    for column, (role, factor) in layout.channels.items():
        own = [(name, e) for name, e in found if split_unit(str(e.get("column")))[0] == split_unit(column)[0]]
        assert own, f"{column} is no channel"
        name, entry = own[0]
        assert name.partition(".")[0] == role
        assert to_si_factor(entry["unit"], None)[0] * entry.get("scale", 1.0) == pytest.approx(factor, rel=1e-9)
    if layout.rate is not None:
        line = next(line for line in text.splitlines() if line.startswith("time = { rate"))
        if layout.rate_is_unknowable:
            assert "ASKED" in line
        else:
            assert f'"{layout.rate:g} Hz"' in line
    assert len(proposal.asked) <= MAX_QUESTION_COUNT
    assert all(question.default and question.consequence for question in proposal.asked)


def test_flat_files_are_read_as_the_columns_that_they_hold(tmp_path):
    given = tmp_path / "given"
    given.mkdir()
    layout = made_layouts.flat_files(given)
    robot = written_urdf(tmp_path / "arm.urdf", 3)
    made = pl.init(tmp_path / "study", files=layout.files, answers={"rate": "200 Hz"}, urdf=robot)
    assert "interleaved = [2, 3]" in made.study_file.read_text()
    assert (made.folder / "recordings" / "arm.urdf").is_file()
    (first, _) = pl.open(made.folder).recordings()
    truth = made_layouts.swing(12)
    n = len(first)
    assert first["position.hinge_2"] == pytest.approx(truth["q"][:n], abs=1e-6)
    assert first["torque.hinge_2"] == pytest.approx(truth["tau"][:n], abs=1e-5)


def test_the_command_proposes_writes_a_page_and_checks(tmp_path, monkeypatch):
    given = tmp_path / "given"
    given.mkdir()
    layout = made_layouts.long_preamble(given)
    folder = tmp_path / "study"
    done = CliRunner().invoke(app, ["init", str(folder), "--from", str(layout.files[0]), "--yes"])
    assert done.exit_code == 0, done.output
    text = (folder / "study.toml").read_text()
    assert 'torque_constant = "0.0603 N*m/A"' in text
    assert "gear_ratio = 100" in text
    assert (folder / "proposal" / "index.html").stat().st_size > 20_000
    assert "Next: pellucid identify" in " ".join(done.output.split())
    assert "Default taken" in done.output


def test_a_persons_name_is_left_out_and_said(tmp_path):
    given = tmp_path / "given"
    given.mkdir()
    layout = made_layouts.person_export(given)
    made = pl.init(tmp_path / "study", files=layout.files)
    page = made.page.read_text()
    assert "Doe" not in page + made.study_file.read_text() + str(made.proposal.remarks)
    assert sum("identifies a person" in remark for remark in made.proposal.remarks) == 2


def test_an_answer_replaces_the_default_and_its_mark(tmp_path):
    given = tmp_path / "given"
    given.mkdir()
    layout = made_layouts.commanded_motor(given)
    _, text = proposed(layout)
    assert "torque_constant" in text
    assert "ASKED: unknown" in text
    made = pl.init(
        tmp_path / "study", files=layout.files, answers={"drive_constant": "2 N*m/A", "effort": "current in A"}
    )
    answered = made.study_file.read_text()
    assert 'torque_constant = "2 N*m/A"' in answered
    with pytest.raises(pl.PellucidError, match="found an answer to colour, expected answers to effort, worn"):
        pl.init(tmp_path / "other", files=layout.files, answers={"colour": "red"})


def test_files_without_numbers_are_refused_by_name(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing here\n")
    with pytest.raises(pl.PellucidError, match=r"found no table of numbers in 1 file: notes\.txt"):
        pl.init(tmp_path / "study", files=[tmp_path / "notes.txt"])
    with pytest.raises(pl.PellucidError, match="no such file, expected a recording or a folder of recordings"):
        pl.init(tmp_path / "study", files=[tmp_path / "gone.csv"])


@pytest.mark.parametrize(
    ("step", "start", "name", "unit"),
    [
        (0.001, 0.0, "c0", "s"),
        (10.0, 5.0, "c0", "ms"),
        (1000.0, 0.0, "c0", "us"),
        (5e6, 1.7e18, "c0", "ns"),
        (2.0, 0.0, "t [ms]", "ms"),
    ],
)
def test_the_unit_of_time_follows_from_its_increments(step, start, name, unit):
    clock = find_clock({name: start + step * np.arange(1000)}, [read_name(name)])
    assert (clock.column, clock.unit) == (name, unit)


def test_increments_that_fit_two_units_are_marked():
    clock = find_clock({"c0": 200.0 * np.arange(1000) + 7.0}, [read_name("c0")])
    assert not clock.is_certain


def test_a_derivative_tells_degrees_beside_radians_a_second():
    p = made_layouts.swing(1)
    (pair,) = find_derivatives({"a": np.degrees(p["q"]), "b": p["dq"], "c": p["tau"]}, p["t"])
    assert (pair.of, pair.by, pair.units) == ("a", "b", (("deg", "rad/s"),))


def test_an_encoder_shows_its_unit_by_its_quantum_and_a_count_its_bits():
    q = made_layouts.swing(2)["q"]
    for unit, turn in (("rad", 2.0 * np.pi), ("deg", 360.0)):
        scaled = q * turn / (2.0 * np.pi)
        found = find_angle_unit(np.round(scaled / (turn / 8192)) * (turn / 8192))
        assert (found.unit, found.is_certain) == (unit, True)
    assert not find_angle_unit(q).is_certain
    counts = np.round(q * 4096 / (2.0 * np.pi))
    assert find_unsigned_bits(np.mod(counts, 2.0**16)) == 16
    assert find_unsigned_bits(np.abs(counts)) is None


def test_weight_tells_degrees_from_radians():
    p = made_layouts.swing(3)
    q = 3.0 * p["q"]
    effort = 2.0 * np.sin(q) + 0.1 * np.tanh(p["dq"])
    for unit, angle in (("deg", np.degrees(q)), ("rad", q)):
        weighed = weigh_turns(effort, motion_samples(angle, p["t"]), FULL_TURNS)
        assert (weighed.best, weighed.is_decided()) == (unit, True)
    assert not weigh_turns(p["dq"], motion_samples(0.01 * q, p["t"]), FULL_TURNS).is_decided()


def test_emg_is_told_by_its_spectrum():
    assert is_raw_emg(made_layouts.emg(4, 4000, 1000.0), 1000.0)
    t = np.arange(4000) / 1000.0
    assert not is_raw_emg(np.sin(2 * np.pi * 50.0 * t), 1000.0)
    assert not is_raw_emg(made_layouts.swing(4)["tau"], 1000.0)


def test_a_flat_list_is_divided_as_it_was_written():
    parts = np.column_stack([k + made_layouts.swing(k)["q"] for k in range(7)])
    assert (find_flat_shape(parts.ravel()).count, find_flat_shape(parts.ravel()).order) == (7, "interleaved")
    assert find_flat_shape(parts.T.ravel(), (7,)).order == "stacked"
    assert find_flat_shape(parts[:, 0]).order == "single"


def test_the_same_motion_with_another_effort_is_noticed():
    p = made_layouts.swing(5)
    found = find_repeated_motion(("empty", p["q"], p["tau"]), ("loaded", np.roll(p["q"], 20), 1.5 * p["tau"]))
    assert (found.lighter, found.heavier) == ("empty", "loaded")
    assert find_repeated_motion(("a", p["q"], p["tau"]), ("b", made_layouts.swing(6)["q"], p["tau"])) is None


def test_a_constant_column_is_nobodys_and_a_wrong_name_is_marked():
    p = made_layouts.swing(7)
    roles = assign_roles({"t": p["t"], "torque": np.full(3000, 2.0), "q": p["q"]}, TableHints())
    left = next(role for role in roles.roles if role.column == "torque")
    assert left.quantity is None
    assert "constant at 2" in left.why


def test_a_unit_that_nothing_tells_is_never_silent(tmp_path):
    """Radians and degrees that look alike: whatever is taken, the line is marked."""
    p = made_layouts.swing(8)
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([p["t"], 0.4 * p["q"], p["tau"]]), delimiter=",", header="t,a,b", comments="")
    proposal = propose_study(read_given([path]), "made")
    text = study_text(proposal, {id(r.table): "recordings/log.csv" for r in proposal.recordings})
    for name in ("position", "torque"):
        line = next(line for line in text.splitlines() if line.startswith(f"{name} = "))
        assert "GUESS" in line or "ASKED" in line


T, Q, DQ, TAU = (made_layouts.swing(5)[key] for key in ("t", "q", "dq", "tau"))


def table(path, **columns):
    """Write columns, whose names stand for those of a file."""
    names = [name.replace("__", " [").replace("_per_", "/") + "]" * ("__" in name) for name in columns]
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(names), comments="")
    return path


DUTY = {"time__s": T, "q__rad": Q, "pwm": np.round(300.0 * TAU)}

UNFIT = {
    "no effort": ({"time__s": T, "q__rad": Q}, "no effort was recorded"),
    "goal alone": ({"time__s": T, "goal position__rad": Q, "present position__rad": Q}, "no effort was recorded"),
    "no position": ({"time__s": T, "torque__N*m": TAU}, "expected a channel position"),
    "accelerations": ({"time__s": T, "acc_x__g": Q, "acc_y__g": DQ, "acc_z__g": TAU}, "no effort was recorded"),
}


@pytest.mark.parametrize("case", UNFIT)
def test_a_study_that_check_refuses_is_not_made(tmp_path, case):
    columns, expected = UNFIT[case]
    path, folder = table(tmp_path / "log.csv", **columns), tmp_path / "study"
    done = CliRunner().invoke(app, ["init", str(folder), "--from", str(path), "--yes"])
    assert isinstance(done.exception, UnfitRecordingError), done.output
    said = str(done.exception)
    assert re.fullmatch(f".*no study was made: .*{expected}.*", said), said
    assert ".draft" not in said
    assert not folder.exists()


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        (
            "time [s],knee angle [rad],knee angle [rad],motor torque [Nm]",
            r'log\.csv: "motor torque \[Nm\]" belongs to none of the 2 joints, because columns 2 and 3 have the same '
            r'name "knee angle \[rad\]": rename or remove one of them',
        ),
        (
            "time [s],knee angle [rad],hip angle [rad],motor torque [Nm]",
            r'log\.csv: "motor torque \[Nm\]" belongs to none of the 2 joints of "knee angle \[rad\]", '
            r'"hip angle \[rad\]", expected the joint in its name',
        ),
    ],
)
def test_an_effort_of_none_of_two_joints_is_named_with_the_columns_of_the_joints(tmp_path, header, expected):
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([T, Q, Q + 0.1, TAU]), delimiter=",", header=header, comments="")
    with pytest.raises(pl.PellucidError, match=expected):
        pl.init(tmp_path / "study", files=[path])


def test_a_folder_that_existed_stays_empty(tmp_path):
    path, folder = table(tmp_path / "log.csv", **UNFIT["no effort"][0]), tmp_path / "study"
    folder.mkdir()
    with pytest.raises(pl.PellucidError, match="no effort was recorded"):
        pl.init(folder, files=[path])
    assert not list(folder.iterdir())


@pytest.mark.parametrize("columns", [{"speed__rpm": DQ * 30.0 / np.pi}, {"velocity__rad_per_s": DQ}, {"q__rad": Q}])
def test_what_init_makes_check_accepts(tmp_path, columns):
    path, folder = table(tmp_path / "log.csv", time__s=T, **columns, torque__Nm=TAU), tmp_path / "study"
    assert CliRunner().invoke(app, ["init", str(folder), "--from", str(path), "--yes"]).exit_code == 0
    assert CliRunner().invoke(app, ["check", str(folder)]).exit_code == 0
    assert sorted(p.name for p in folder.iterdir()) == ["proposal", "recordings", "study.toml"]


def test_joints_without_a_robots_file_become_one_study(tmp_path):
    path = table(tmp_path / "log.csv", t__s=T, q1__rad=Q, q2__rad=DQ, **{"tau1__N*m": TAU, "tau2__N*m": TAU + DQ})
    made = pl.init(tmp_path / "study", files=[path])
    assert any("2 joints (joint_1, joint_2) and no URDF" in remark for remark in made.proposal.remarks)
    study = pl.open(made.folder)
    assert [joint.name for joint in study.rig.joints] == ["joint_1", "joint_2"]
    assert all(joint.dead_band > 0.0 for joint in study.rig.joints)
    assert study.model.gravity == "sine+cosine"
    assert "joint_1.inertia" in pl.identify(study, families=["symmetric"], thorough=False)


def test_the_joints_of_a_study_have_names_that_it_accepts(tmp_path):
    path = table(tmp_path / "log.csv", t__s=T, q1__rad=Q, q2__rad=DQ, **{"tau1__N*m": TAU, "tau2__N*m": TAU + DQ})
    proposal = propose_study(read_given([path]), "made")
    labels = {"joint_1": "arm/1", "joint_2": "arm 1"}
    roles = proposal.main.roles
    changed = replace(
        roles,
        joints=tuple(labels.values()),
        roles=tuple(replace(role, label=labels.get(role.label, role.label)) for role in roles.roles),
    )
    proposal = replace(proposal, main=replace(proposal.main, roles=changed))
    text = study_text(proposal, {id(r.table): "log.csv" for r in proposal.recordings})
    study = tomllib.loads(text)
    assert [joint["name"] for joint in study["rig"]["joints"]] == ["arm_1", "arm_1_2"]
    assert set(study["channels"]["position"]) == {"arm_1", "arm_1_2"}


def test_the_supply_voltage_of_a_duty_is_asked(tmp_path):
    path = table(tmp_path / "log.csv", **DUTY)
    proposal = propose_study(read_given([path]), "made")
    assert {q.key: q.default for q in (*proposal.asked, *proposal.marked)}["supply_voltage"] == "unknown"
    made = pl.init(tmp_path / "study", files=[path], answers={"supply_voltage": "12 V"})
    assert 'supply = "12 V"  # said by the lab\n' in made.study_file.read_text()
    assert not [fault for fault in pl.check(pl.open(made.folder)) if fault.severity == "refuse"]
    # A column with the voltage answers it.
    supplied = table(tmp_path / "supplied.csv", **DUTY, battery__V=12.0 + 0.01 * Q)
    proposal = propose_study(read_given([supplied]), "made")
    assert "supply_voltage" not in {q.key for q in (*proposal.asked, *proposal.marked)}


def test_a_robots_file_beside_recordings_is_read(tmp_path):
    path = table(tmp_path / "log.csv", time__s=T, q__rad=Q, torque__Nm=TAU)
    command = ["init", str(tmp_path / "study"), "--from", str(path), "--yes"]
    done = CliRunner().invoke(app, [*command, "--urdf", str(tmp_path / "gone.urdf")])
    assert "gone.urdf: not readable: no such file" in str(done.exception)
    assert not (tmp_path / "study").exists()
    done = CliRunner().invoke(app, [*command, "--urdf", str(path)])
    assert "log.csv: not readable as XML" in str(done.exception)
    done = CliRunner().invoke(app, [*command, "--dataset", "emps"])
    assert "init needs exactly one of --from" in str(done.exception)
    made = pl.init(tmp_path / "study", files=[path], urdf=written_urdf(tmp_path / "one.urdf", 1))
    assert any("one.urdf: not used" in remark for remark in made.proposal.remarks)


def test_a_file_with_two_rates_gives_a_table_for_each(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    content = ezc3d.c3d()
    n = 400
    points = np.ones((4, 2, n))
    points[:3] = np.random.default_rng(0).standard_normal((3, 2, n))
    content["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    content["parameters"]["POINT"]["LABELS"]["value"] = ["wrist", "elbow"]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["data"]["points"] = points
    swing = made_layouts.swing(6, n=10 * n, fs=1000.0)
    content["parameters"]["ANALOG"]["RATE"]["value"] = [1000.0]
    content["parameters"]["ANALOG"]["LABELS"]["value"] = ["position", "torque"]
    content["parameters"]["ANALOG"]["UNITS"]["value"] = ["rad", "Nm"]
    content["data"]["analogs"] = np.stack([swing["q"], swing["tau"]])[None]
    content.write(str(tmp_path / "two.c3d"))
    tables = read_given([tmp_path / "two.c3d"]).tables
    assert [{len(x) for x in t.columns.values()} for t in tables] == [{10 * n}, {n}]
    made = pl.init(tmp_path / "study", files=[tmp_path / "two.c3d"])
    assert {r.column for r in made.proposal.main.channels} >= {"position", "torque"}
    assert made.proposal.rate == pytest.approx(1000.0)


def storage(path, degrees, **columns):
    """Write a file as OpenSim stores it, whose header states the unit of angles."""
    head = f"made\nversion=1\nnRows={len(T)}\nnColumns={1 + len(columns)}\ninDegrees={degrees}\nendheader\n"
    rows = np.column_stack([T, *columns.values()])
    body = "\n".join("\t".join(f"{x:.6f}" for x in row) for row in rows)
    path.write_text(head + "\t".join(("time", *columns)) + "\n" + body + "\n")
    return path


def test_joints_of_the_side_without_emg_and_the_tension_in_extension_are_not_proposed(tmp_path):
    """An estimator of the right leg got seventeen angles, and the trunk's extension was a force in newtons."""
    names = ("hip_flexion_r", "knee_angle_r", "hip_flexion_l", "knee_angle_l", "lumbar_extension", "lumbar_bending")
    rng = np.random.default_rng(6)
    moved = {name: 20.0 * np.sin((3.0 + k) * T) + 0.01 * rng.standard_normal(len(T)) for k, name in enumerate(names)}
    turned = {f"{name}_moment": 0.3 * x for name, x in moved.items()}
    muscles = ("soleus_r", "vas_lat_r", "bifemlh_r")
    pulled = {name: np.abs(np.sin((2.0 + k) * T)) * 0.4 for k, name in enumerate(muscles)}
    files = [
        storage(tmp_path / "ik.sto", "yes", **moved), storage(tmp_path / "id.sto", "no", **turned),
        storage(tmp_path / "emgFilt.sto", "no", **pulled),
    ]  # fmt: skip
    proposal = propose_study(read_given(files), "s")
    roles = [r for layout in proposal.layouts for r in layout.channels]
    assert {r.label for r in roles if r.quantity == "angle"} == {
        "hip_flexion_r", "knee_r", "lumbar_extension", "lumbar_bending",
    }  # fmt: skip
    assert {r.unit for r in roles if r.quantity == "angle"} == {"deg"}
    assert not [r for r in roles if r.label.endswith("_l") or r.quantity == "force"]
    assert any("2 angles and moments of the left side are excluded" in text for text in proposal.remarks)


def test_a_direction_of_a_joint_names_no_tension():
    assert read_name("lumbar_extension").quantity is None
    assert read_name("cabletension").quantity == "force"
