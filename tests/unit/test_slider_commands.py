"""A joint with a carriage, through the commands: from a rig's file to a report, and recordings that are not fit."""

import json
import re
import shutil
import tomllib

import numpy as np
import pytest
from typer.testing import CliRunner

import pellucid
from pellucid import cli
from pellucid._errors import PellucidError, StudyError
from pellucid.models.slider_joint import read_slider_card
from pellucid.study.procedures.run import check
from pellucid.study.results import read_rows
from pellucid_lab.elbow import protocol as elbow_protocol
from pellucid_lab.elbow.protocol import trials
from pellucid_lab.elbow.rig import ElbowRig, able_elbow, drawn_rigs
from pellucid_lab.init import start_study
from pellucid_lab.known_rigs import rig_names, rig_text
from pellucid_lab.simulate import study_name
from pellucid_lab.study import write_study

run = CliRunner().invoke


def few():
    """Three places of the carriage and one trial to judge by, each shorter than the protocol's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(elbow_protocol, "CONSTANT_SPEEDS_TURNS", (3.5, 8.5))
        patch.setattr(elbow_protocol, "HOLD_COUNT", 4)
        made = trials(able_elbow())
    kept = [t for t in made if re.fullmatch(r"(constant|sweep|static)_[136]", t.name)]
    return (*kept, next(t for t in made if t.name == "unseen_constant_2"))


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("small") / "elbow"
    start_study(folder, "able-elbow")
    write_study(folder, able_elbow(), name="elbow", seed=1, trials=few())
    return folder


@pytest.fixture
def elbow(small, tmp_path):
    """A copy to spoil."""
    shutil.copytree(small, tmp_path / "elbow")
    return tmp_path / "elbow"


def change(path, how):
    """A recording's table, changed."""
    head, _, body = path.read_text(encoding="utf-8").partition("\n")
    table = np.genfromtxt(body.splitlines(), delimiter=",")
    how(table, head.split(","))
    text = "\n".join(",".join("" if np.isnan(v) else f"{v:.10g}" for v in row) for row in table)
    path.write_text(f"{head}\n{text}\n", encoding="utf-8")


def told(folder, severity):
    return [f for f in check(pellucid.open(folder)) if f.severity == severity]


def test_a_sound_study_is_fit(small):
    assert told(small, "refuse") == []


def add_worn_recording(folder, along, across):
    """A recording in which somebody turns the elbow slowly, whose axis lies beside the robot's [m]."""
    time = np.arange(0.0, 30.0, 0.01)
    limb = 1.3 + 0.6 * np.sin(0.9 * time)
    cuff = 0.16 * np.exp(1j * limb) + along + 1j * across
    head, body = "time,position,current,carriage,forearm", (
        1e3 * time, np.angle(cuff), 0.4 * np.sign(np.cos(0.9 * time)) + 0.05 * np.sin(7.0 * time), np.abs(cuff), limb,
    )  # fmt: skip
    np.savetxt(folder / "recordings" / "worn.csv", np.column_stack(body), delimiter=",", header=head, comments="")
    text = (folder / "study.toml").read_text(encoding="utf-8")
    recording = """
[[recordings]]
name = "worn"
file = "recordings/worn.csv"
protocol = "free_carriage"
channels.time = { column = "time", unit = "ms" }
channels.position = { column = "position", unit = "rad", scale = 1.0 }
channels.current = { column = "current", unit = "A", scale = 1.0 }
channels.length.carriage = { column = "carriage", unit = "m" }
channels.angle.limb = { column = "forearm", unit = "rad" }
"""
    (folder / "study.toml").write_text(text + recording, encoding="utf-8")


@pytest.mark.slow
def test_the_commands_go_through(elbow):
    add_worn_recording(elbow, 0.010, -0.006)
    result = run(cli.app, ["check", str(elbow)])
    assert result.exit_code == 0, result.output
    result = run(cli.app, ["identify", "-v", str(elbow)])
    assert result.exit_code == 0, result.output
    assert "three steps, one set for each direction" in result.output
    assert "load_motoring" in result.output
    assert max(len(line) for line in result.output.splitlines() if str(elbow) not in line) <= 80
    rows = {r.id: r for r in read_rows(elbow / "results.json")}
    assert (rows["elbow.load.error"].unit, rows["elbow.load.error"].split) == ("A", "heldout")
    assert rows["elbow.load.torque_error"].unit == "N*m"
    assert rows["elbow.slider.constant_1"].value == pytest.approx(0.12, abs=1e-3)
    assert rows["elbow.dissociated.coulomb_up"].unit == "N*m"
    assert rows["elbow.axis_along.worn"].value == pytest.approx(0.010, abs=1e-3)
    assert rows["elbow.axis_across.worn"].value == pytest.approx(-0.006, abs=1e-3)
    assert "Offset of the wearer's axis from the robot's" in result.output
    card = read_slider_card(elbow / "models" / "slider.load.json")
    assert card["inertia"].value == rows["elbow.load.inertia"].value
    assert card.model().names == tuple(p.name for p in card.parameters)
    assert card.known["carriage_mass"] == pytest.approx(0.48)
    assert read_slider_card(elbow / "models" / "slider.dissociated.json").model().up.shape == (8,)
    assert len(list((elbow / "models").glob("slider.*.json"))) == 6
    result = run(cli.app, ["compare", str(elbow), str(elbow)])
    assert "No parameter changed" in result.output
    result = run(cli.app, ["report", str(elbow)])
    assert result.exit_code == 0, result.output
    page = (elbow / "report" / "index.html").read_text(encoding="utf-8")
    for anchor in ("found", "directions", "errors", "geometry", "methods", "provenance"):
        assert f'id="{anchor}"' in page
    # The recordings are simulated: no figure says that their current was measured.
    assert "its current, simulated, and as each model predicts it" in page
    assert "mm: simulated (black" in page
    assert not re.search(r">measured<|current, measured|: measured", page)
    assert "http" not in re.sub(r"http://www\.w3\.org\S*|https?://[\w./]*matplotlib\S*", "", page.lower())
    result = run(cli.app, ["identify", str(elbow), "--json"])
    assert {"elbow.load.error"} <= {row["id"] for row in json.loads(result.stdout)["figures"]}


def test_families_are_for_other_joints(small):
    with pytest.raises(PellucidError, match="have no friction families; omit --family"):
        pellucid.identify(pellucid.open(small), families=["load"])


def test_a_card_of_another_kind_is_refused(tmp_path):
    (tmp_path / "joint.json").write_text('{"format": 1}')
    with pytest.raises(PellucidError, match="joint with a carriage"):
        read_slider_card(tmp_path / "joint.json")


# --- recordings that are not fit ------------------------------------------------------------------------------------


def test_a_missing_direction(elbow):
    """Only what goes up: the samples of each way down are cut out by windows that end before it."""
    text = (elbow / "study.toml").read_text(encoding="utf-8")
    # The first movement of a constant-velocity trial lifts; the sweep's two ways are left out altogether.
    text = re.sub(r"(\[\[recordings\]\]\nname = \"constant_.*?\n)(?=\n|\Z)", r'\1window = ["0 s", "2.6 s"]\n', text, flags=re.S)  # fmt: skip  # noqa: E501
    text = text.replace('protocol = "swept_sine"', 'protocol = "other"')
    (elbow / "study.toml").write_text(text, encoding="utf-8")
    (fault,) = [f for f in told(elbow, "refuse") if f.kind == "excitation"]
    assert re.search(r"constant_1, .*found \d+ samples moving up and 0 moving down, expected both", fault.message)


def test_a_carriage_that_stands_still(elbow):
    text = (elbow / "study.toml").read_text(encoding="utf-8")
    head, *entries = text.split("\n[[recordings]]")
    kept = [e for e in entries if "_1.csv" in e or "unseen" in e]
    (elbow / "study.toml").write_text("\n[[recordings]]".join([head, *kept]), encoding="utf-8")
    (fault,) = told(elbow, "refuse")
    assert "slider positions do not vary: found 1" in fault.message
    assert "expected at least 3" in fault.message
    with pytest.raises(PellucidError, match="slider positions do not vary"):
        pellucid.identify(pellucid.open(elbow))


def test_lost_markers(elbow):
    def lose(table, heads):
        table[1000:1400, [heads.index(f"C_{axis}") for axis in "xyz"]] = np.nan

    change(elbow / "recordings" / "sweep_3_markers.csv", lose)
    found = [f for f in told(elbow, "note") if f.kind == "lost_marker" and f.file == "sweep_3_markers.csv"]
    assert found[0].channel == "C"
    assert "longest loss 2.2" in found[0].message

    def lose_all(table, heads):
        table[:, [heads.index(f"C_{axis}") for axis in "xyz"]] = np.nan

    change(elbow / "recordings" / "sweep_3_markers.csv", lose_all)
    (fault,) = told(elbow, "refuse")
    assert (fault.file, fault.channel, fault.kind) == ("sweep_3_markers.csv", "C", "lost_marker")
    assert "found it in 0 of" in fault.message


def test_clocks_that_differ_by_80_ms(elbow):
    truth = json.loads((elbow / "lab" / "truth.json").read_text(encoding="utf-8"))

    def late(table, heads):
        table[:, 0] += 0.080

    change(elbow / "recordings" / "sweep_3_markers.csv", late)
    (fault,) = [f for f in told(elbow, "note") if f.kind == "clock" and f.file == "sweep_3_markers.csv"]
    delay = float(re.search(r"events ([\d.]+) ms later", fault.message)[1])
    assert delay == pytest.approx(80.0 - 1e3 * truth["trials"]["sweep_3"]["clock_offset"], abs=2.0)


def test_a_saturated_current(elbow):
    """Clipped where the drive's limit is not: left out. Resting at the limit: told."""

    def cut(table, heads):
        i = heads.index("current")
        table[:, i] = np.clip(table[:, i], -1e6, 0.8 * table[:, i].max())

    change(elbow / "recordings" / "sweep_3.csv", cut)
    assert not told(elbow, "refuse")
    assert {(f.file, f.channel, f.kind) for f in told(elbow, "cut")} == {("sweep_3.csv", "current", "clipped")}

    def rest(table, heads):
        table[3000:3400, heads.index("current")] = 8000.0

    change(elbow / "recordings" / "sweep_6.csv", rest)
    (fault,) = [f for f in check(pellucid.open(elbow)) if f.file == "sweep_6.csv" and f.channel == "current"]
    assert "400 samples" in fault.message
    assert "limit" in fault.expected


def test_a_reversed_current(elbow):
    text = (elbow / "study.toml").read_text(encoding="utf-8")
    text = text.replace('column = "current", unit = "mA"', 'column = "current", unit = "mA", sign = -1')
    (elbow / "study.toml").write_text(text, encoding="utf-8")
    (fault,) = told(elbow, "refuse")
    assert "sign of channel position or of channel current is reversed" in fault.message


def test_a_carriage_beyond_its_rail(elbow):
    text = (elbow / "study.toml").read_text(encoding="utf-8").replace('high = "0.27 m"', 'high = "0.2 m"')
    (elbow / "study.toml").write_text(text, encoding="utf-8")
    found = told(elbow, "refuse")
    assert {f.kind for f in found} == {"place"}
    with pytest.raises(PellucidError, match=r"found the carriage at 2\d\d.\d mm, expected 120 mm to 200 mm"):
        pellucid.identify(pellucid.open(elbow))


# --- a rig's own file -----------------------------------------------------------------------------------------------


def test_a_bench_joint_from_the_commands(tmp_path):
    folder = tmp_path / "my bench.1"
    result = run(cli.app, ["init", str(folder), "--rig", "bench-joint"])
    assert f"Next: pellucid simulate '{folder}'" in " ".join(result.output.split("\n"))
    rig = folder / "lab" / "rig.toml"
    text = rig.read_text(encoding="utf-8").replace("duration = 20.0", "duration = 4.0")
    rig.write_text(text, encoding="utf-8")
    result = run(cli.app, ["simulate", str(folder), "--seed", "3"])
    assert result.exit_code == 0, result.output
    assert "study 'my-bench-1', 4 recordings, 16 s of motion" in result.output
    first = (folder / "recordings" / "multisine.csv").read_bytes()
    made = pellucid.simulate(folder, seed=3)
    assert (made.recordings, made.joint_time) == (4, 16.0)
    assert (folder / "recordings" / "multisine.csv").read_bytes() == first


@pytest.mark.parametrize(
    ("folder", "name"), [("my.elbow", "my-elbow"), (".._Elbow_2-a", "Elbow_2-a"), ("...", "study")]
)
def test_a_folder_gives_its_study_a_name_that_may_be(tmp_path, folder, name):
    assert study_name(tmp_path / folder) == name


def test_init_refuses_what_it_cannot_make(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("")
    with pytest.raises(StudyError, match="holds mine"):
        pellucid.init(tmp_path / "full", rig="able-elbow")
    with pytest.raises(StudyError, match="unknown rig 'shoulder'; known: able-arm, able-elbow"):
        pellucid.init(tmp_path / "new", rig="shoulder")
    with pytest.raises(StudyError, match="init needs exactly one of --from"):
        pellucid.init(tmp_path / "new", dataset="any", rig="able-elbow")
    assert not (tmp_path / "new").exists()


def test_simulate_refuses_what_it_cannot_understand(tmp_path):
    with pytest.raises(StudyError, match=r"rig\.toml: no such file"):
        pellucid.simulate(tmp_path)
    pellucid.init(tmp_path / "new", rig="bench-joint")
    rig = tmp_path / "new" / "lab" / "rig.toml"
    text = rig.read_text(encoding="utf-8")
    for wrong, said in (
        ("x = ", "not valid TOML"),
        ('kind = "leg"', "found kind = 'leg'"),
        (text.replace("torque_constant", "constant"), r"\[drive\]: found constant, expected some of torque_constant"),
    ):
        rig.write_text(wrong, encoding="utf-8")
        with pytest.raises(StudyError, match=said):
            pellucid.simulate(tmp_path / "new")
    (tmp_path / "new" / "study.toml").write_text("")
    with pytest.raises(StudyError, match="would overwrite"):
        pellucid.simulate(tmp_path / "new")


def test_simulate_does_not_replace_a_study_that_was_changed_by_hand(tmp_path):
    folder = tmp_path / "joint"
    pellucid.init(folder, rig="bench-joint")
    pellucid.simulate(folder, seed=1)
    pellucid.simulate(folder, seed=2)
    written = (folder / "study.toml").read_text(encoding="utf-8")
    (folder / "study.toml").write_text(written + "# our own remark\n", encoding="utf-8")
    with pytest.raises(StudyError, match=r"study\.toml: found changes since .* expected none"):
        pellucid.simulate(folder, seed=1)
    assert "our own remark" in (folder / "study.toml").read_text(encoding="utf-8")
    pellucid.simulate(folder, seed=2, overwrite=True)
    assert (folder / "study.toml").read_text(encoding="utf-8") == written


def test_drawn_rigs_are_written_as_they_were_drawn():
    assert "able-elbow-drawn-5" in rig_names()
    for i, drawn in enumerate(drawn_rigs(able_elbow())):
        text = rig_text(f"able-elbow-drawn-{i + 1}")
        assert ElbowRig.parse(text, drawn.name) == drawn
        assert {path: tuple(ends) for path, ends in tomllib.loads(text)["drawn"].items()} == able_elbow()["drawn"]


def test_reproduce_prints_its_lines(tmp_path, monkeypatch):
    from types import SimpleNamespace

    from pellucid.study.answer import Answer

    asked, answer = [], Answer("Do the paper's claims hold?", "yes", "all of them")

    def reproduce(paper, out, *, on_progress=None):
        asked.append((paper, out))
        return SimpleNamespace(lines=["Table 1: as printed"], page=out / "index.html", answer=answer)

    monkeypatch.setattr("pellucid_lab.papers.reproduce.reproduce", reproduce)
    result = run(cli.app, ["reproduce", "able", "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert "Table 1: as printed" in result.output
    assert asked == [("able", tmp_path / "out")]
