"""Several joints without a robot's file: each is identified as a study of that joint alone would, or listed."""

import numpy as np
import pytest
from typer.testing import CliRunner

from pellucid import check, compare, identify, open, report
from pellucid._errors import IdentificationError, PellucidError
from pellucid.cli import app
from pellucid.joint.study.each_joint_result import _recording_steps
from pellucid.joint.study.joint_findings import ONE_FILE_ADVICE
from pellucid.study.answer import Answer, Step
from pellucid.study.pages.page import write_page

RATE, SECONDS = 100.0, 24.0
TRUTH = {"hip": (0.18, 7.0, 0.3, 0.5), "knee": (0.04, 1.9, 0.1, 0.15)}  # inertia, gravity, viscous, coulomb
FAST = {"families": ["symmetric"], "thorough": False}

HEAD = """\
name = "leg"
{rig}
[channels]
time = {{ column = "t", unit = "s" }}
{channels}
[processing]
lowpass = "10 Hz"
trim = 20
dead_band = "0.02 rad/s"
[model]
gravity = "sine+cosine"
[[recordings]]
name = "first"
file = "log.csv"
window = ["0 s", "16 s"]
[[recordings]]
name = "last"
file = "log.csv"
window = ["16 s", "30 s"]
use = "validate"
"""


def swing(rng):
    """Return time, angle, speed and acceleration of a sum of sines."""
    t = np.arange(int(SECONDS * RATE)) / RATE
    w = 2.0 * np.pi * np.array([0.11, 0.29, 0.53, 0.97]) * rng.uniform(0.9, 1.1, 4)
    size, angle = np.array([0.7, 0.35, 0.2, 0.1]), np.outer(t, w) + rng.uniform(0.0, 6.0, 4)
    return t, np.sin(angle) @ size, np.cos(angle) @ (size * w), -np.sin(angle) @ (size * w**2)


def columns_of(rng, names):
    """Return the columns of joints that do not act on each other."""
    columns = {}
    for name in names:
        inertia, gravity, viscous, coulomb = TRUTH[name]
        t, q, v, a = swing(rng)
        effort = inertia * a + gravity * np.sin(q) + viscous * v + coulomb * np.sign(v)
        columns |= {"t": t, f"q_{name}": q, f"tau_{name}": effort + 0.01 * effort.std() * rng.standard_normal(len(t))}
    return columns


def coupled_columns(rng):
    """Return the columns of a planar arm of two links, with the hip's axis and the knee's alike."""
    (t, q1, v1, a1), (_, q2, v2, a2) = swing(rng), swing(rng)
    both, m11, m22, weights = 0.12 * np.cos(q2), 0.25, 0.05, (8.0, 2.0)
    turn = 0.12 * np.sin(q2)
    hip = (m11 + 2.0 * both) * a1 + (m22 + both) * a2 - turn * (2.0 * v1 * v2 + v2**2)
    hip += weights[0] * np.sin(q1) + weights[1] * np.sin(q1 + q2) + 0.3 * np.sign(v1)
    knee = (m22 + both) * a1 + m22 * a2 + turn * v1**2 + weights[1] * np.sin(q1 + q2) + 0.1 * np.sign(v2)
    noise = 0.02 * rng.standard_normal((2, len(t)))
    return {"t": t, "q_hip": q1, "tau_hip": hip + noise[0], "q_knee": q2, "tau_knee": knee + noise[1]}


@pytest.fixture
def make_leg(tmp_path):
    """Return a function that makes a study of joints from columns, or of one joint if `alone` names it."""

    def make(columns, joints, alone=None, changes=()):
        folder = tmp_path / (alone or "leg")
        folder.mkdir(exist_ok=True)
        table = np.column_stack(list(columns.values()))
        np.savetxt(folder / "log.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
        ending = {name: "" if alone else f".{name}" for name in joints}
        rig = "".join(
            f'[[rig.joints]]\nname = "{name}"\nmotion = "rotary"\n[rig.joints.drive]\nkind = "torque"\n'
            for name in joints
        )
        channels = "".join(
            f'position{ending[name]} = {{ column = "q_{name}", unit = "rad" }}\n'
            f'torque{ending[name]} = {{ column = "tau_{name}", unit = "N*m" }}\n'
            for name in joints
        )
        text = HEAD.format(rig=rig, channels=channels)
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (folder / "study.toml").write_text(text)
        return open(folder)

    return make


@pytest.fixture
def columns(rng):
    return columns_of(rng, ("hip", "knee"))


def test_a_joint_among_several_is_identified_as_alone(make_leg, columns):
    found = identify(make_leg(columns, ["hip", "knee"]), **FAST)
    values = {row.id: row.value for row in found.rows}
    for joint, (inertia, gravity, *_) in TRUTH.items():
        alone = identify(make_leg(columns, [joint], joint), **FAST)
        for row in alone.rows:
            assert values.pop(row.id.replace("leg.", f"leg.{joint}.", 1)) == row.value
        assert found[f"{joint}.inertia"].value == pytest.approx(inertia, rel=0.03)
        assert found[f"{joint}.gravity"].value == pytest.approx(gravity, rel=0.01)
    assert not values
    assert [v.kind for v in found.verdicts if v.finding == "each_joint"] == ["note"]
    assert not [v for v in found.verdicts if v.finding == "coupled_joints"]


def test_what_rests_or_has_no_effort_is_listed(make_leg, columns, rng):
    still = 0.3 + 1e-5 * rng.standard_normal(len(columns["t"]))
    more = {"q_torso": still, "tau_torso": 5.0 + still, "q_hand": swing(rng)[1], "tau_hand": 0.0 * still}
    study = make_leg({**columns, **more}, ["torso", "hip", "hand", "knee"])
    said = [fault for fault in check(study) if fault.kind == "resting_joint"]
    assert [(fault.severity, fault.channel) for fault in said] == [
        ("note", "position.torso"),
        ("note", "position.hand"),
    ]
    found = identify(study, **FAST)
    assert (list(found.joints), list(found.resting)) == (["hip", "knee"], ["torso", "hand"])
    assert "2 of 4 separately identified joints have a prediction error of at most 20 %" in found.headline
    assert "not moved: torso, hand" in found.headline
    table = found.tables[0]
    assert [row[0] for row in table.rows] == ["torso", "hip", "hand", "knee"]
    assert [row[-1] for row in table.rows][::2] == ["not moved", "not moved"]


def test_a_joint_with_a_reversed_drive_is_left_out(make_leg, columns):
    study = make_leg({**columns, "tau_knee": -columns["tau_knee"]}, ["hip", "knee"])
    faults = check(study)
    assert not [fault for fault in faults if fault.severity == "refuse"]
    assert any("knee: excluded" in fault.message for fault in faults if fault.severity == "warn")
    found = identify(study, **FAST)
    assert (list(found.joints), list(found.left_out)) == (["hip"], ["knee"])
    (said,) = (verdict for verdict in found.verdicts if verdict.finding == "left_out")
    assert said.kind == "warning"
    assert "sign" in said.text


def test_without_any_joint_the_exit_status_says_so(make_leg, columns):
    columns = {**columns, "tau_hip": 0.0 * columns["t"], "q_knee": 0.0 * columns["t"]}
    study = make_leg(columns, ["hip", "knee"])
    assert {fault.severity for fault in check(study) if fault.kind == "resting_joint"} == {"refuse"}
    with pytest.raises(IdentificationError, match="none of 2 joints can be identified"):
        identify(study, **FAST)
    ran = CliRunner().invoke(app, ["identify", str(study.folder)])
    assert ran.exit_code not in (0, 70)


def test_joints_that_act_on_each_other_are_told(make_leg, rng):
    found = identify(make_leg(coupled_columns(rng), ["hip", "knee"]), **FAST)
    said = [verdict for verdict in found.verdicts if verdict.finding == "coupled_joints"]
    assert sorted(verdict.text.split()[3] for verdict in said) == ["hip", "knee"]
    assert all(verdict.kind == "warning" and "URDF" in verdict.do for verdict in said)


def test_the_page_and_the_terminal_tell_all_joints(make_leg, columns, tmp_path):
    study = make_leg({**columns, "q_torso": 0.0 * columns["t"], "tau_torso": 0.0 * columns["t"]}, [*TRUTH, "torso"])
    found = identify(study, **FAST)
    found.save(study)
    assert {path.name for path in study.models_dir.iterdir()} >= {"joint_hip.json", "joint_knee.symmetric.json"}
    text = str(found)
    assert "hip: Parameters with symmetric friction" in text
    assert "not moved" in text
    from pellucid.joint.study.each_joint_page import page

    made = page(study, found)
    assert made.answer.verdict == "yes"
    assert [section.id for section in made.sections] == ["joints", "hip", "knee", "provenance"]
    assert "torso" in write_page(tmp_path / "page", made).read_text()
    # What was kept is drawn again as it is.
    assert report(open(study.folder), only_kept=True).is_file()


@pytest.mark.parametrize("more", [[], ["--to", "mjcf"]])
def test_a_command_that_takes_one_joint_says_what_to_do(make_leg, columns, more):
    study = make_leg(columns, ["hip", "knee"])
    ran = CliRunner().invoke(app, ["export", str(study.folder), *more])
    assert ran.exit_code not in (0, 70)
    assert "URDF" in str(ran.output) + str(ran.exception)


def test_a_step_that_all_joints_share_is_named_once():
    """Each of two joints asked for a second recording in a line of its own."""
    shared, own = Step("Record a second recording"), Step("Record slowly")
    answers = {"hip": Answer("?", "yes", "", next=(shared, own)), "knee": Answer("?", "yes", "", next=(shared,))}
    assert [step.text for step in _recording_steps(answers)] == ["Record a second recording", "hip: Record slowly"]


def test_studies_are_compared_joint_by_joint(make_leg, columns):
    study = make_leg(columns, ["hip", "knee"])
    identify(study, **FAST).save(study)
    with pytest.raises(PellucidError, match=r"cards of several joints \(joint_hip.json, joint_knee.json\)"):
        compare(study.folder, study.folder)
    card = study.models_dir / "joint_hip.json"
    assert not any(row.changed for row in compare(card, card).rows)


def test_a_joint_may_have_a_dead_band_of_its_own(make_leg, columns):
    changes = [('name = "knee"\n', 'name = "knee"\ndead_band = "0.2 rad/s"\n')]
    found = identify(make_leg(columns, ["hip", "knee"], changes=changes), **FAST)
    plain = identify(make_leg(columns, ["hip", "knee"]), **FAST)
    assert found["hip.inertia"].value == plain["hip.inertia"].value
    assert found["knee.inertia"].value != plain["knee.inertia"].value


HALVES = """
[[recordings]]
name = "second"
file = "recordings/{file}"
use = "validate"
window = ["10 s", "20 s"]
"""


def test_parts_of_one_file_differ_in_neither_payload_nor_machine(make_study):
    columns = make_study.swing(4000)
    columns["i"] = columns["i"] + np.where(columns["t"] > 10.0, 0.2, 0.0) * np.gradient(columns["q"], columns["t"])
    first = ('use = "fit"', 'use = "fit"\nwindow = ["0 s", "10 s"]')
    for file, is_one in (("sweep.csv", True), ("other.csv", False)):
        study = make_study(columns, first, append=HALVES.format(file=file))
        recorded = study.folder / "recordings"
        (recorded / "other.csv").write_bytes((recorded / "sweep.csv").read_bytes())
        (told,) = (v for v in identify(study, **FAST).verdicts if v.finding == "contradicting_recordings")
        assert (told.do == ONE_FILE_ADVICE) == is_one
        assert ("payload that is not stated" in told.do) == (not is_one)

