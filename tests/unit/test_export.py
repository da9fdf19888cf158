"""An exported controller: its folder, and how it behaves through its C interface, here and on a Cortex-M4F."""

import ctypes
import json
import math
import re
import shutil
import subprocess
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from exported import Loaded, Output, nonsense, written
from typer.testing import CliRunner

import pellucid
from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.cli import app
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.export.c_folder import check_on_host, read_constants, write_c_folder
from pellucid.controllers.export.controller_values import ControllerValues, joint_values, protect_wearer
from pellucid.controllers.export.export_answer import export_answer, save_answer
from pellucid.controllers.export.microcontroller import OnCortexM4, measure, missing_tools
from pellucid.controllers.export.replay_vector import SUPERVISOR_VARIANTS
from pellucid.controllers.instruments import COMMISSIONING_CONDITION, Instruments
from pellucid.controllers.residual_compensator import design
from pellucid.controllers.supervised import PROBE_ANSWER_ERROR, PROBE_ANSWER_NAMES, SUPERVISOR_NAMES, unheard_energies
from pellucid.controllers.supervisor_faults import UNMEASURED_FAULTS, UNSEEN_FAULTS, describe_drive_watch
from pellucid.models.card import CardParameter, ModelCard, write_card
from pellucid.models.slider_joint import SliderCard
from pellucid.study.exporter import core_headers, needed_headers
from pellucid.study.results import read_answers

compiled = pytest.mark.skipif(
    not all(map(shutil.which, ("make", "cc", "c++", "nm"))), reason="make, cc, c++ or nm is not installed"
)
on_m4 = pytest.mark.skipif(bool(missing_tools()), reason=f"not installed: {', '.join(missing_tools())}")

STUDY = """
name = "bench"
[rig]
joint = "elbow"
motion = "rotary"
lifts = "flexion"
limits = { position_min = "-30 deg", position_max = "120 deg", velocity = "6 rad/s", effort = "5 N*m" }
[rig.drive]
kind = "torque"
[channels]
time = { column = "t", unit = "s" }
position = { column = "q", unit = "rad" }
torque = { column = "u", unit = "N*m" }
[processing]
lowpass = "20 Hz"
[[recordings]]
name = "a"
file = "recordings/a.csv"
use = "fit"
"""

COMMISSIONING_GUIDES = ("commission-a-drive.md", "integrate-the-supervisor.md")
BODY = {"inertia": 0.05, "gravity": 1.5, "offset": 0.1, "coulomb": 0.3, "viscous": 0.1, "load_friction": 0.2}
UNITS = {"inertia": "kg*m^2", "viscous": "N*m*s/rad", "load_friction": "1"}


def parameter(name, value, spread=0.0):
    unit = UNITS.get(name, "N*m")
    return CardParameter(name, unit, value, spread / 2, (value - spread, value + spread))


@pytest.fixture
def study(tmp_path):
    """A joint that was identified, on disk."""
    return made_study(tmp_path)


def made_study(tmp_path):
    """A joint that was identified, in a folder."""
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "a.csv").write_text("t,q,u\n0,0,0\n", encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    card = ModelCard(
        study="bench", family="load", method="ls", motion="rotary", effort_unit="N*m", lifts="flexion",
        parameters=tuple(parameter(n, v, 0.1 * v) for n, v in BODY.items()), covariance=(), known={},
        velocity_range=4.0, drive={"gain": 2.0, "back_emf": 0.0}, heldout_effort_error=None, processing="none",
        confidence=0.95, checksums={}, pellucid="0",
    )  # fmt: skip
    (tmp_path / "models").mkdir()
    write_card(tmp_path / "models" / "joint.json", card)
    return pellucid.open(tmp_path)


def worn():
    """A worn orthosis, without a study's recordings."""
    coupling = Coupling(0.05, 0.02, 1.6, 0.05, 0.3, 0.1, 8.0, 14.0, 0.5, actuator_frequency=60.0, delay=0.002)
    numbers = design(coupling, 0.002).control_law().values
    return ControllerValues("worn", numbers, {}, ("orthosis.json",), {})


@pytest.fixture
def joint(study, tmp_path):
    values = joint_values(study)
    return Loaded(written(values, tmp_path / "c"), values)


@pytest.fixture
def unplayed(monkeypatch):
    """No compiler is found, so that exports do not play their test vector: what is read of them is text."""
    monkeypatch.setattr("shutil.which", lambda tool: None)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """An exported joint and an exported worn orthosis, each compiled and checked once; nothing changes them."""
    joint = pellucid.export(made_study(tmp_path_factory.mktemp("joint")))
    found = {"joint": joint, "worn": write_c_folder("bench", worn(), tmp_path_factory.mktemp("worn") / "c")}
    return {law: (folder, subprocess.run(["make", "-s", "check"], cwd=folder, capture_output=True, text=True))
            for law, folder in found.items()}  # fmt: skip


@compiled
@pytest.mark.parametrize("law", ["joint", "worn"])
def test_a_folder_that_compiles_without_a_warning_and_answers_as_recorded(folders, law):
    folder, run = folders[law]
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == "wrong 0"
    flags = (folder / "Makefile").read_text(encoding="utf-8")
    assert all(f in flags for f in ("-Wall -Wextra", "-Wconversion", "-Werror", "-ffp-contract=off"))


@compiled
def test_a_probe_is_exported_and_answers_as_recorded(study):
    folder = pellucid.export(study, probe=True)
    run = subprocess.run(["make", "-s", "check"], cwd=folder, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == "wrong 0"
    words = (folder / "README.md").read_text(encoding="utf-8").split()
    # Recordings need not be zero where the joint hangs.
    assert "the joint's encoder, with zero and sign as in the recordings" in " ".join(words)
    waves = r"waves of effort of up to [0-9.]+ N\*m \(\d+ % of the effort limit\) at \d+, \d+ and \d+ Hz"
    assert re.search(waves, " ".join(words))
    assert "responses in the first movement after each start are the reference" in " ".join(words)


def test_a_probes_answer_at_commissioning_is_exported(study, unplayed):
    path, answer = study.folder / "study.toml", (5.0, -1.0, 4.0, -2.0, 3.0, -3.5)
    stated = f"[rig.instruments]\nprobe = true\nprobe_answer = {list(answer)}\n"
    path.write_text(path.read_text(encoding="utf-8").replace("[channels]", f"{stated}[channels]", 1), encoding="utf-8")
    folder = pellucid.export(pellucid.open(study.folder))
    numbers = read_constants(folder)
    assert tuple(numbers[name] for name in PROBE_ANSWER_NAMES) == answer
    assert numbers["probe_answer_error"] == pytest.approx(PROBE_ANSWER_ERROR)
    readme = " ".join((folder / "README.md").read_text(encoding="utf-8").split())
    assert "| answer to the probe at commissioning | used | from study.toml |" in readme
    # Windows of another duration: the export took no notice of the answer, and called it stated.
    other = path.read_text(encoding="utf-8").replace("probe_answer =", 'probe_window = "0.5 s"\nprobe_answer =', 1)
    path.write_text(other, encoding="utf-8")
    folder = pellucid.export(pellucid.open(study.folder))
    assert read_constants(folder)["probe_answer_error"] == 0.0
    listed = (folder / "README.md").read_text(encoding="utf-8")
    assert "| answer to the probe at commissioning | not used: the windows of this export last " in listed
    path.write_text(other.replace('probe_window = "0.5 s"\n', "", 1), encoding="utf-8")
    folder = pellucid.export(pellucid.open(study.folder))
    assert "compares the responses with probe_answer" in readme
    assert "first movement after each start" not in readme


@compiled
def test_a_controller_says_what_its_robot_answered_the_probe(study, tmp_path):
    """As the same law in Python does, in single precision; nothing before it has started or where nothing is given."""
    values = joint_values(study)
    values = replace(values, instruments=replace(values.instruments, probe=True))
    robot = Loaded(written(values, tmp_path / "c"), values)
    here = values.supervised.changed(**SUPERVISOR_VARIANTS["law"]).start(single=True)
    assert robot.probe_answer() == ((0.0,) * 6, 0)
    assert robot.core.pellucid_probe_answer(None, None) == 0
    assert robot.init() == 0
    for k in range(1000):
        position = 0.4 * math.sin(3e-3 * k)
        assert robot.step(position).effort == here.step(1e-3 * k, position)
    assert robot.probe_answer() == here.probe_answer
    assert here.probe_answer[1] > 0


def test_an_export_that_cannot_see_its_drive_asks_it(study, unplayed):
    """By a probe, unless somebody says twice that it shall not; each fault that is then not found is named."""
    folder = pellucid.export(study)
    assert read_constants(folder)["probe_effort"] > 0.0
    assert "A probe tests the drive" in export_answer(study, "c", folder).sentence
    said = r"neither measured nor probed, .* --unmeasured .* reversed polarity: detected"
    with pytest.raises(PellucidError, match=said):
        pellucid.export(study, probe=False)
    blind = pellucid.export(study, probe=False, unmeasured=True, overwrite=True)
    assert read_constants(blind)["probe_effort"] == 0.0
    answer = export_answer(study, "c", blind)
    assert answer.badge == "Yes (limited fault detection)"
    assert [line for line in answer.details if line[2:] in UNMEASURED_FAULTS] == [f"- {f}" for f in UNMEASURED_FAULTS]
    # Energies of simulated elbows alone stood there, for a robot of any size.
    stuck, wrong, dead = unheard_energies(read_constants(blind))
    own = [float(re.search(r"about (\S+) J", line)[1]) for line in answer.details[1:4]]
    assert answer.details[0].startswith("Energy of an undetected fault on this robot")
    assert own == pytest.approx([stuck, wrong, dead], rel=0.1)


@pytest.mark.parametrize("to", ["c", "fmu", "ros2_control"])
def test_each_form_of_a_law_says_what_it_protects_from(study, to, unplayed):
    """A package for ros2_control said nothing of an unmeasured drive."""
    numbers = read_constants(pellucid.export(study))
    answer = export_answer(study, to, pellucid.export(study, to, overwrite=True))
    watch = describe_drive_watch(numbers)
    assert (answer.sentence, answer.details) == (f"{watch.said}.", watch.details)
    assert answer.basis is not None
    assert answer.basis.counted == "model card"
    assert answer.next


def test_the_energy_of_faults_is_that_of_the_exported_robot():
    """The same 1.9 to 4.2 J stood in the export of a robot of 2 N m and in that of one of 44 N m."""
    light = {"gravity_sine": 2.0, "effort_limit": 10.0, "velocity_limit": 8.0}
    heavy = {"gravity_sine": 44.0, "effort_limit": 80.0, "velocity_limit": 8.0}
    said = []
    for robot in (light, heavy):
        values = LAWS["joint"].defaults | robot | {"inertia": robot["gravity_sine"] / 40.0, "period": 1e-3}
        made = pellucid.supervised(ControlLaw("joint", values), instruments=Instruments(probe=True), start_up=False)
        numbers = values | made.supervision
        stuck, wrong, dead = unheard_energies(numbers)
        assert stuck == pytest.approx(0.5 * robot["effort_limit"] * numbers["probe_travel"])
        assert wrong == 2.0 * dead == pytest.approx(2.0 * robot["gravity_sine"] * numbers["probe_travel"], rel=0.05)
        said.append(describe_drive_watch(numbers).details)
    assert "- effort stuck at half of its limit: about 4.6 J" in said[0]
    assert said[1][1:4] == (
        "- effort stuck at half of its limit: about 32 J",
        "- reversed polarity or three times the effort: about 70 J",
        "- no effort: about 35 J",
    )


def watched(**changes):
    robot = {"inertia": 1.1, "gravity_sine": 44.0, "effort_limit": 80.0, "velocity_limit": 8.0, "period": 1e-3,
             "rate_limit": 8000.0, "position_min": -math.inf, "position_max": math.inf}  # fmt: skip
    values = LAWS["joint"].defaults | robot | changes
    return values | pellucid.supervised(ControlLaw("joint", values), instruments=Instruments()).supervision


def test_without_a_probe_the_energy_is_that_of_a_movement_of_this_robot():
    numbers = watched(position_min=-1.0, position_max=1.0)
    assert unheard_energies(numbers)[0] == pytest.approx(40.0 * 2.0)
    details = describe_drive_watch(numbers).details
    assert details[0] == "Energy of an undetected fault on this robot, over the range of positions:"
    assert details[1] == "- effort stuck at half of its limit: about 80 J"
    unlimited = describe_drive_watch(watched()).details
    assert unlimited[:2] == (
        "Energy of an undetected fault on this robot, over 1 rad:",
        "- effort stuck at half of its limit: about 40 J",
    )
    assert "not known in J" in describe_drive_watch(numbers, "A").details[0]


def test_the_start_up_wave_is_told_with_its_size_and_a_warning():
    """A wave of half of the effort limit was called small."""
    numbers = watched()
    share, duration = 100.0 * numbers["test_effort"] / 80.0, 2e3 * numbers["test_samples"] * 1e-3
    size, _, warning = describe_drive_watch(numbers).details[-3:]
    assert size.endswith(f" N·m, {share:.0f} % of the effort limit, {duration:.0f} ms.")
    assert warning == "The wearer feels it: warn them before each start."
    calm = describe_drive_watch({**numbers, "test_effort": 4.0}).details
    assert calm[-2].startswith("Start-up wave: 4 N·m, 5 % of the effort limit")


def test_an_export_doubts_torques_that_no_worn_robot_has():
    """N*mm that were read as N*m gave bounds of 10 kJ, and the reverse 0.01 J, without a remark."""
    unit = "Check the unit of the effort in [channels], such as N*mm instead of N*m."
    assert unit not in describe_drive_watch(watched()).details
    for scale in (1e-3, 1e3):
        wrong = {"inertia": 1.1 * scale, "gravity_sine": 44.0 * scale, "effort_limit": 80.0 * scale}
        details = describe_drive_watch(watched(**wrong)).details
        assert details[0].startswith("Warning: ")
        assert details[1] == unit
    assert "Warning" not in describe_drive_watch(watched(), "N").details[0]


@pytest.mark.parametrize("changes", [{}, {"position_min": -1.0, "position_max": 1.0}])
@pytest.mark.parametrize("drive", [{"drive_expected": 1.0}, {"probe_effort": 1.0, "probe_travel": 0.8}, {}])
def test_lines_of_an_export_fit_a_terminal_and_say_nothing_twice(drive, changes):
    """One paragraph had 200 words."""
    watch = describe_drive_watch({**watched(**changes), "probe_answer_error": 0.0, **drive})
    assert [line for line in watch.details if len(line) > 80 and line[2:] not in UNSEEN_FAULTS] == []
    assert len(f"Yes. {watch.said}.") <= 80
    assert len(set(watch.details)) == len(watch.details)


def test_an_export_says_that_its_model_is_in_doubt(study, unplayed):
    told = {"command": "identify", "verdict": "no", "reason": "the error on 2 held-out recordings is 40 %"}
    study.results_path.write_text(json.dumps({"figures": [], "answers": [told]}), encoding="utf-8")
    folder = pellucid.export(study)
    answer = export_answer(study, "c", folder)
    assert answer.sentence.endswith("The model is in doubt: the error on 2 held-out recordings is 40 %.")
    save_answer(study, "c", answer)
    save_answer(study, "c", answer)
    assert [each["command"] for each in read_answers(study.results_path)] == ["identify", "export"]


def test_a_controller_that_computes_otherwise_on_a_microcontroller_is_no_export(study, unplayed):
    found = OnCortexM4(steps=100, wrong=3, instructions=2000.0, most=2500, code=10, constants=1, memory=9)
    answer = export_answer(study, "c", pellucid.export(study), measured=found)
    assert (answer.badge, answer.reason) == ("No", "3 of 100 steps on a Cortex-M4F differ from this machine's")


def test_a_measured_drive_is_not_asked(study, unplayed):
    path = study.folder / "study.toml"
    stated = "[rig.instruments.drive_sensor]\nlargest_effort = \"9 N*m\"\n"
    path.write_text(path.read_text(encoding="utf-8").replace("[channels]", f"{stated}[channels]", 1), encoding="utf-8")
    folder = pellucid.export(pellucid.open(study.folder))
    numbers = read_constants(folder)
    assert numbers["probe_effort"] == 0.0
    assert numbers["shaking_limit"] == pytest.approx(0.016 * numbers["velocity_limit"], rel=1e-6)
    answer = export_answer(study, "c", folder)
    assert answer.badge == "Yes"
    assert "compares the drive's measured effort" in answer.sentence


def test_a_clock_of_32_bits_may_turn_over(study, tmp_path):
    """An export's step takes times that wrap around, of the step and of its samples."""
    values = joint_values(study)
    law = values.supervised.start(single=True)
    read, turn = [], 1 << 32
    for k in range(600):
        now = (turn - 300_000 + 1000 * k) % turn
        position = (0.4 + 0.01 * math.sin(1e-2 * k), k, (now - 50) % turn, True)
        read.append(law.step_samples(now, [position] + [(0.0, k, now, True)] * 2))
    assert law.fault == "none"


def test_a_probe_is_refused_where_the_controller_is_too_slow(study):
    said = r"probe: found a control rate of 250 Hz, expected at least 500 Hz.*--no-probe --unmeasured"
    with pytest.raises(PellucidError, match=said):
        pellucid.export(study, probe=True, period=0.004)
    assert not (study.folder / "controller").exists()


@compiled
def test_a_wrong_answer_is_found(folders, tmp_path):
    folder = shutil.copytree(folders["joint"][0], tmp_path / "c")
    (folder / "build" / "check.o").unlink()
    outputs = folder / "test" / "vector_outputs.h"
    text = outputs.read_text(encoding="utf-8")
    at = text.index("{ 0x", text.index("vector_outputs[")) + len("{ 0x")
    other = "0" if text[at + 7] != "0" else "1"
    outputs.write_text(text[: at + 7] + other + text[at + 8 :], encoding="utf-8")
    run = subprocess.run(["make", "-s", "check"], cwd=folder, capture_output=True, text=True)
    assert run.returncode != 0
    assert "wrong 1" in run.stdout


@compiled
@pytest.mark.parametrize("law", ["joint", "worn"])
def test_every_law_needs_no_heap_and_no_library_but_memory_and_root(folders, law):
    folder, _ = folders[law]
    listed = subprocess.run(
        ["nm", "-u", "build/controller.o"], cwd=folder, capture_output=True, text=True, check=True
    ).stdout
    allowed = {"memcpy", "memmove", "memset", "sqrtf", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
    assert {line.split()[-1] for line in listed.splitlines()} <= allowed


@compiled
@on_m4
@pytest.mark.parametrize("law", ["joint", "worn"])
def test_a_cortex_m4_answers_bit_by_bit_as_the_host(folders, law):
    found = measure(folders[law][0])
    assert found.wrong == 0
    assert found.steps > 500
    assert 100 < found.instructions <= found.most < 5000
    assert found.bytes < 39 * 1024  # more than half of it the supervisor
    assert found.memory == 8 + _core.supervised_storage(law)


@pytest.mark.nightly
@compiled
@on_m4
def test_a_fused_multiply_add_is_found_out(folders, tmp_path):
    """What the flag in the Makefile is for: without it a Cortex-M4F rounds differently."""
    folder = shutil.copytree(folders["worn"][0], tmp_path / "c", ignore=shutil.ignore_patterns("build"))
    fused = subprocess.run(
        ["make", "-s", "m4", "EXACT=-O2 -ffp-contract=fast -fno-math-errno"], cwd=folder, capture_output=True, text=True
    )
    assert fused.returncode != 0
    told = dict(line.split() for line in fused.stdout.splitlines())
    assert 10 < int(told["wrong"]) < int(told["steps"])


@compiled
def test_what_is_carried_is_gravity_and_friction(joint):
    """Against the inverse dynamics of the card in double precision, once the filter has settled."""
    assert joint.init() == 0
    velocity = 1.5
    for _ in range(400):
        position = -0.4 + velocity * joint.count * 1e-3
        output = joint.step(position)
    n = joint.values.numbers
    weight = n["gravity_sine"] * np.sin(position)
    smooth = np.tanh(velocity / n["velocity_width"])
    load = n["load_generating"] if weight * velocity < 0 else n["load_motoring"]
    friction = (n["coulomb_positive"] + load * abs(weight)) * smooth + n["viscous_positive"] * velocity
    assert output.fault == 0
    assert output.effort == pytest.approx(weight + n["offset"] + 0.8 * friction, abs=2e-3)
    # The lower end of every friction's interval, never the value: what is left resists.
    assert n["coulomb_positive"] == pytest.approx(0.9 * BODY["coulomb"])


@compiled
def test_the_worn_law_is_the_one_that_python_runs(tmp_path):
    values = worn()
    robot = Loaded(written(values, tmp_path / "c"), values)
    here = ControlLaw(values.law, values.numbers)
    assert robot.init() == 0
    largest = 0.0
    for i in range(600):
        t = i * 0.002
        q, spring, muscle = 0.5 * np.sin(3 * t), 0.4 * np.cos(3 * t), 2 * np.sin(3 * t + 0.4)
        said = robot.step(q, spring, muscle)
        expected = here.step(t, q, spring, muscle)
        assert said.fault == 0
        largest = max(largest, abs(expected))
        assert said.effort == pytest.approx(expected, abs=5e-3)
    assert largest > 0.5


@compiled
def test_emg_that_says_nothing_is_no_fault(tmp_path):
    values = worn()
    robot = Loaded(written(values, tmp_path / "c"), values)
    robot.init()
    for _ in range(100):
        output = robot.step(0.2, 0.1, np.nan)
    assert output.fault == 0
    assert np.isfinite(output.effort)
    assert robot.step(0.2, np.nan, 0.0).fault == 2


FAULTS = _core.FAULTS
WRONG = {
    "nan": ({"value": np.nan}, 2),
    "infinite": ({"value": -np.inf}, 2),
    "not valid": ({"valid": 0}, 2),
    "old": ({"time_us": 10**6 + 5_000}, 3),
    "from the future": ({"time_us": 2 * 10**6}, 4),
    "number backwards": ({"sequence": 20}, 4),
    "clock far back": ({"time_us": -(2**63)}, 4),
    "clock far ahead": ({"now_us": 2**63 - 1}, 3),
    "too fast": ({"value": 1.5}, 5),
}


@compiled
@pytest.mark.parametrize("what", WRONG)
def test_a_fault_latches_at_once_and_the_effort_goes_to_zero(joint, what):
    changed, fault = WRONG[what]
    joint.init()
    for _ in range(40):
        before = joint.step(0.5)
    assert before.fault == 0
    assert before.effort > 0.5
    first = joint.step(0.5, **changed)
    change = joint.values.numbers["rate_limit"] * joint.values.numbers["period"]
    assert first.fault == fault
    assert first.effort == pytest.approx(max(before.effort - change, 0.0), abs=1e-6)
    efforts = [joint.step(0.5) for _ in range(60)]
    assert all(e.fault == fault for e in efforts)
    assert np.all(np.diff([e.effort for e in efforts]) <= 0)
    assert efforts[-1].effort == 0.0
    assert joint.init() == 0
    assert joint.step(0.5).fault == 0


@compiled
def test_a_start_does_not_clear_a_fault_but_an_operator_does(joint):
    joint.init()
    for _ in range(40):
        joint.step(0.5)
    joint.core.pellucid_stop(joint.context)
    stopped = [joint.step(0.5) for _ in range(40)][-1]
    assert (stopped.fault, stopped.effort) == (6, 0.0)
    assert stopped.challenge != 0
    assert joint.init(power_on=False) == 6
    assert [joint.step(0.5, token=stopped.challenge + 1).fault for _ in range(60)][-1] == 6
    assert [joint.step(0.5, token=stopped.challenge).fault for _ in range(60)][-1] == 0
    entry = joint.core.pellucid_log(joint.context, 0)
    assert (entry.fault, joint.core.pellucid_log(joint.context, 1).fault) == (6, 0)
    # What is switched on with everything at work tests polarity first.
    assert joint.init(test_effort=1.0, test_least=0.01) == 0
    assert [joint.step(0.5).fault for _ in range(400)][-1] == FAULTS.index("polarity")
    assert joint.step(0.5).enable == 0


@compiled
def test_a_drive_that_does_not_do_as_it_is_told_has_its_power_taken(joint):
    joint.init(drive_expected=1.0, drive_tolerance=0.2)
    output = joint.step(0.5, drive=0.0)
    for _ in range(40):
        output = joint.step(0.5, drive=output.effort)
    assert (output.fault, output.enable) == (0, 1)
    late = 0
    while output.enable:
        output, late = joint.step(0.5, drive=5.0), late + 1
    assert FAULTS[output.fault] == "drive_stuck"
    assert late <= 4
    watchdog = (ctypes.c_uint32 * 2)()
    powered = [joint.core.pellucid_watchdog_step(watchdog, beat, 1, 3) for beat in (1, 2, 2, 2, 2, 2, 3)]
    assert powered == [1, 1, 1, 1, 1, 0, 1]


@compiled
def test_a_sample_seen_again_is_borne_twice(joint):
    joint.init()
    joint.step(0.5)
    faults = [joint.step(0.5, sequence=1, time_us=joint.now).fault for _ in range(4)]
    assert faults == [0, 0, 3, 3]


@compiled
def test_a_lost_sample_and_a_number_that_wraps_around_are_no_fault(joint):
    joint.init()
    joint.count = 2**32 - 5
    for i in range(20):
        if i == 10:
            joint.now, joint.count = joint.now + joint.period, joint.count + 1
        assert joint.step(0.3, sequence=joint.count % 2**32).fault == 0


@compiled
def test_stop_and_what_was_never_started(joint):
    assert joint.step(0.5).fault == 7
    assert joint.init(inertia=0.0, coulomb_positive=-1.0) == 1
    out = joint.step(0.5)
    assert (out.fault, out.effort, out.enable) == (1, 0.0, 0)
    assert joint.init() == 0
    for _ in range(40):
        joint.step(0.5)
    joint.core.pellucid_stop(joint.context)
    assert [joint.step(0.5).fault for _ in range(60)][-1] == 6
    assert joint.step(0.5).effort == 0.0
    assert joint.core.pellucid_init(None, None) == 7
    assert joint.core.pellucid_init(joint.context, None) == 1
    assert joint.core.pellucid_step(None, None, None) == 1
    output = Output()
    joint.init()
    assert joint.core.pellucid_step(joint.context, None, ctypes.byref(output)) == 2
    joint.core.pellucid_stop(None)


@compiled
def test_whatever_comes_in_what_goes_out_is_finite_within_its_limit_and_its_rate(joint, rng):
    nonsense(joint, rng)


@compiled
def test_a_worn_orthosis_too(tmp_path, rng):
    nonsense(Loaded(written(worn(), tmp_path / "c"), worn()), rng)


def test_limits_come_from_the_study(study):
    n = joint_values(study).numbers
    assert (n["effort_limit"], n["velocity_limit"]) == (5.0, 6.0)
    assert (n["position_min"], n["position_max"]) == pytest.approx((-np.pi / 6, 2 * np.pi / 3))


def test_a_joint_with_a_carriage_says_where_it_is(study):
    names = ("inertia", "carriage_moment", "carriage_mass", "gravity", "gravity_cosine")
    names += ("coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative")
    values = (0.03, -0.004, 0.5, 1.1, 0.2, 0.3, 0.2, 0.05, 0.04)
    card = SliderCard(
        study="bench", family="consistent", method="", motion="rotary", effort_unit="N*m", lifts="flexion",
        parameters=tuple(parameter(n, v) for n, v in zip(names, values, strict=True)), covariance=(), known={},
        rail=(0.1, 0.3), drive={"gain": 1.0}, heldout_error=None, residual_sd=0.0, processing="", confidence=0.95,
        notes=(), checksums={}, pellucid="0",
    )  # fmt: skip
    (study.models_dir / "joint.json").unlink()
    write_card(study.models_dir / "slider.consistent.json", card)
    middle, end = joint_values(study).numbers, joint_values(study, slider=0.3).numbers
    assert middle["gravity_sine"] == pytest.approx(1.1 + 9.80665 * 0.5 * 0.2)
    assert end["inertia"] == pytest.approx(0.03 - 2 * 0.004 * 0.3 + 0.5 * 0.09)
    with pytest.raises(PellucidError, match=r"found the carriage at 0.4 m, expected 0.1 to 0.3 m"):
        joint_values(study, slider=0.4)
    two = replace(card, family="dissociated", parameters=tuple(parameter(f"p{i}", 0.1) for i in range(16)))
    write_card(study.models_dir / "slider.dissociated.json", two)
    with pytest.raises(PellucidError, match="do not describe a rigid body"):
        joint_values(study, card="slider.dissociated.json")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"to": "rust"}, 'found to = "rust", expected "c"'),
        ({"participant": "S1"}, "the joint is not worn"),
        ({"period": 0.0}, "expected one above 0"),
        ({"card": "other.json"}, "no such model card"),
        ({"slider": 0.2}, "this joint has no carriage"),
    ],
)
def test_what_cannot_be_exported_is_told(study, given, said):
    with pytest.raises(PellucidError, match=said):
        pellucid.export(study, **given)
    assert not (study.folder / "controller").exists()


HOSTILE = 'N*m */\nint owned(void);\n#error "owned" \\\n/* '


def planted(study, **changed):
    """The study's card, changed by hand."""
    path = study.models_dir / "joint.json"
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8")) | changed), encoding="utf-8")
    return study


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"effort_unit": HOSTILE}, r"found the effort_unit .* expected one of N\*m, A, V"),
        ({"effort_unit": "N"}, "found the effort_unit 'N', expected"),
        ({"motion": HOSTILE}, "found the motion .* expected one of rotary, prismatic"),
        ({"motion": ["rotary"]}, "not a model card"),
        ({"effort_unit": {"N*m": 1}}, "not a model card"),
    ],
)
def test_a_card_in_a_unit_that_is_none_is_refused(study, changed, said):
    with pytest.raises(PellucidError, match=said):
        pellucid.export(planted(study, **changed))
    assert not (study.folder / "controller").exists()


@pytest.mark.parametrize("unit", [HOSTILE, "m # */ int x; /*", "", 3])
def test_a_cards_parameter_in_a_unit_that_is_none_is_refused(study, unit):
    card = json.loads((study.models_dir / "joint.json").read_text(encoding="utf-8"))
    card["parameters"][0]["unit"] = unit
    with pytest.raises(PellucidError, match=r"joint\.json: (inertia: |.*unit: found 3)"):
        pellucid.export(planted(study, parameters=card["parameters"]))


def test_no_word_of_a_study_or_a_card_leaves_its_comment(study, tmp_path, unplayed):
    """Whatever names, remarks, notes and units say: the code is the same without its comments."""

    def code(values, name, folder):
        made = write_c_folder(name, values, tmp_path / folder)
        texts = [p.read_text(encoding="utf-8") for p in sorted(made.glob("*.[hc]*"))]
        return [re.sub(r"/\*.*?\*/|//[^\n]*", "", text, flags=re.DOTALL) for text in texts]

    good = joint_values(study)
    remarks = dict.fromkeys(good.numbers, HOSTILE)
    bad = replace(good, effort_unit=HOSTILE, cards=(HOSTILE,), checksums={HOSTILE: HOSTILE}, remarks=remarks)
    assert code(bad, HOSTILE, "bad") == code(good, "bench", "good")


@compiled
def test_what_lies_in_the_folder_already_is_neither_compiled_nor_run(study, tmp_path):
    folder, sign = study.folder / "controller", tmp_path / "owned"
    (folder / "include").mkdir(parents=True)
    (folder / "include" / "cstddef").write_text("#error owned\n", encoding="utf-8")
    (folder / "build").mkdir()
    (folder / "build" / "record").write_text(f"#!/bin/sh\ntouch {sign}\n", encoding="utf-8")
    (folder / "build" / "record").chmod(0o755)
    with pytest.raises(PellucidError, match="controller: found include, which an export of Pellucid did not write"):
        pellucid.export(study)
    pellucid.export(study, overwrite=True)
    assert check_on_host(folder)[1] == 0
    (folder / "GNUmakefile").write_text(f"record check:\n\ttouch {sign}\n", encoding="utf-8")
    assert check_on_host(folder)[1] == 0
    with pytest.raises(PellucidError, match="found GNUmakefile, expected none"):
        pellucid.export(study)
    assert not sign.exists()


@pytest.mark.parametrize("how", ["relative", "absolute", "link"])
def test_a_card_outside_the_study_only_where_that_is_said(study, tmp_path, how):
    other = tmp_path.parent / f"{tmp_path.name}-other.json"
    (study.models_dir / "joint.json").rename(other)
    (study.models_dir / "link.json").symlink_to(other)
    card = {"relative": f"../../{other.name}", "absolute": str(other), "link": "link.json"}[how]
    run = CliRunner().invoke(app, ["export", str(study.folder), "--card", card])
    assert isinstance(run.exception, PellucidError)
    assert "outside the study's folder, expected a file in it; --allow-outside" in str(run.exception)
    assert joint_values(study, card=card, allow_outside=True).numbers["gravity_sine"] == 1.5


def test_a_folder_is_whole_without_a_compiler(study, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda tool: None)
    folder = pellucid.export(study)
    assert not (folder / "test" / "vector_outputs.h").exists()
    assert "make record" in (folder / "README.md").read_text(encoding="utf-8")
    assert sorted(p.name for p in (folder / "include" / "pellucid").iterdir()) == sorted(
        {*needed_headers("joint_compensation.hpp"), *needed_headers("incident_recorder.hpp"), "watchdog.hpp"}
    )


def test_constants_are_the_same_floats(study, unplayed):
    values = protect_wearer(joint_values(study))
    folder = pellucid.export(study)
    text = (folder / "pellucid_constants.h").read_text(encoding="utf-8")
    body = text[text.index("= {") :].splitlines()[1:]
    read = [np.float32(line.split("f,")[0]) for line in body if "f, /*" in line]
    largest = np.finfo(np.float32).max  # stands for no limit
    numbers = {**values.numbers, **values.supervised.supervision}
    expected = [np.float32(numbers[n]) for n in (*LAWS["joint"].parameters, *SUPERVISOR_NAMES)]
    assert read == [np.clip(x, -largest, largest) for x in expected]
    assert "identified as 0.05, 0.045 to 0.055" in text


def test_headers_are_where_an_installed_package_has_them():
    assert (core_headers() / "pellucid" / "safety.hpp").is_file()
    cmake = (Path(__file__).parents[2] / "CMakeLists.txt").read_text(encoding="utf-8")
    assert "install(DIRECTORY include/pellucid DESTINATION pellucid/include)" in cmake


@compiled
@on_m4
def test_the_command_writes_what_it_measured(study):
    run = CliRunner().invoke(app, ["export", str(study.folder), "--to", "c", "--period", "0.002"])
    assert run.exit_code == 0, run.output
    assert "equal to this machine's bit by bit" in run.output
    figures = json.loads(study.results_path.read_text(encoding="utf-8"))["figures"]
    found = {f["id"]: f["value"] for f in figures if f["command"] == "export"}
    assert set(found) == {f"bench.export.m4.{n}" for n in ("instructions_per_step", "bytes", "memory", "wrong")}
    assert found["bench.export.m4.wrong"] == 0
    assert "2.0e-03f, /* period" in (study.folder / "controller" / "pellucid_constants.h").read_text(encoding="utf-8")
    assert asdict(joint_values(study, period=0.002))["numbers"]["max_age"] == pytest.approx(0.01)


def test_a_study_without_a_joint_is_told_what_there_is_for_it(study):
    asked = '[assessment]\ncontrol = "Ctrl"\nangle = "position"\n'
    text = STUDY.replace('[rig.drive]\nkind = "torque"\n', asked)
    text = text.replace('use = "fit"', 'participant = "P1"\ncondition = "Ctrl"') + "[participants.P1]\n"
    (study.folder / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(PellucidError, match=r"found no \[rig.drive\].*pellucid assess"):
        pellucid.export(pellucid.open(study.folder))


def test_without_a_measured_drive_the_first_line_says_what_is_not_found(study, unplayed):
    path = study.folder / "study.toml"
    folder = pellucid.export(study)
    readme = (folder / "README.md").read_text(encoding="utf-8")
    watch = describe_drive_watch(read_constants(folder))
    assert readme.splitlines()[2] == f"> **{watch.said}.**"
    assert [line for line in watch.details if f"> {line}\n" not in readme] == []
    assert export_answer(study, "c", folder).sentence == f"{watch.said}."
    assert "| measurement of the drive's effort | no | assumed, a typical value |" in readme
    assert "The start-up test is not commissioned" in readme
    printed = CliRunner().invoke(app, ["export", str(study.folder)])
    assert printed.exit_code == 0
    question, said, *_ = printed.stdout.splitlines()
    assert max(map(len, printed.stdout.splitlines()[:-2])) <= 80
    assert question == "Can this controller be exported, and what does it protect from?"
    assert said == f"Yes. {watch.said}."
    assert "\nBased on 1 model card.\n" in printed.stdout
    (stored,) = json.loads(study.results_path.read_text(encoding="utf-8"))["answers"]
    assert (stored["command"], stored["procedure"]) == ("export", "c")
    assert (stored["verdict"], stored["said"]) == ("yes", f"{watch.said}.")
    assert stored["details"] == list(watch.details)
    stated = '[rig.instruments]\nstart_up_answer = "14 mJ"\n[rig.instruments.drive_sensor]\noffset = "0.2 N*m"\n'
    path.write_text(path.read_text(encoding="utf-8").replace("[channels]", f"{stated}[channels]", 1), encoding="utf-8")
    folder = pellucid.export(pellucid.open(study.folder))
    readme = (folder / "README.md").read_text(encoding="utf-8")
    assert watch.said not in readme
    assert "| its offset | 0.2 N*m | from study.toml |" in readme
    assert "not commissioned" not in readme
    numbers = read_constants(folder)
    assert (numbers["drive_expected"], numbers["drive_offset"]) == (1.0, pytest.approx(0.2))
    assert (numbers["test_least"], numbers["test_most"]) == pytest.approx((0.2 * 0.014, 1.75 * 0.014))
    constants = (folder / "pellucid_constants.h").read_text(encoding="utf-8")
    assert " * its offset: 0.2 N*m, from study.toml" in constants


def test_every_text_asks_that_nobody_wears_the_robot_at_commissioning(study, unplayed):
    readme = (pellucid.export(study) / "README.md").read_text(encoding="utf-8")
    assert COMMISSIONING_CONDITION in readme
    assert "relaxed wearer" not in readme
    help_text = " ".join(CliRunner().invoke(app, ["commission", "--help"]).stdout.replace("│", " ").split())
    guides = Path(__file__).parents[2] / "docs" / "how-to"
    pages = [(guides / name).read_text(encoding="utf-8") for name in COMMISSIONING_GUIDES]
    assert all(COMMISSIONING_CONDITION.partition(",")[0] in text for text in (help_text, *pages))


def test_a_readme_tells_what_is_stated_also_where_it_is_typical(study, unplayed):
    path = study.folder / "study.toml"
    stated = "[rig.instruments]\nshaking = false\n[rig.instruments.drive_sensor]\nlag = \"2 ms\"\n"
    path.write_text(path.read_text(encoding="utf-8").replace("[channels]", f"{stated}[channels]", 1), encoding="utf-8")
    readme = (pellucid.export(pellucid.open(study.folder)) / "README.md").read_text(encoding="utf-8")
    for words, value, source in (
        ("its lag", "0.002 s", "from study.toml"),
        ("its relative error", "0.05", "assumed, a typical value"),
        ("measurement of the drive's effort", "yes", "from study.toml"),
        ("work of the start-up wave at commissioning", "not measured", "not stated"),
        ("probe of encoder and drive while the law runs", "no", "chosen by the export"),
        ("check for sustained oscillation (shaking)", "no", "from study.toml"),
    ):
        assert f"| {words} | {value} | {source} |" in readme
    assert "force sensor |" not in readme, "this law uses none"
    assert "| `drive` | N*m | measured effort of the drive |" in readme


@pytest.mark.parametrize("measured", [False, True])
def test_a_readmes_loop_reads_what_this_controller_reads(study, unplayed, measured):
    if measured:
        path = study.folder / "study.toml"
        stated = "[rig.instruments]\nsecond_encoder = true\n[rig.instruments.drive_sensor]\n"
        text = path.read_text(encoding="utf-8").replace("[channels]", f"{stated}[channels]", 1)
        path.write_text(text, encoding="utf-8")
    readme = (pellucid.export(pellucid.open(study.folder)) / "README.md").read_text(encoding="utf-8")
    assert ("drive_time_us, drive_is_valid }" in readme) == measured
    assert ("input.joint = " in readme) == measured
    assert "heartbeat(output.steps);" in readme
    assert ("an encoder that drifts" in readme) != measured
    assert ("a drive sensor that is wrong by the same factor" in readme) == measured


@pytest.mark.parametrize(
    ("drive", "unit"),
    [('kind = "current"\ntorque_constant = "2 N*m/A"', "A"), ('kind = "voltage"\ntorque_constant = "2 N*m/V"', "V")],
)
def test_a_readme_names_the_unit_of_the_drives_command(study, unplayed, drive, unit):
    path = study.folder / "study.toml"
    text = path.read_text(encoding="utf-8").replace('kind = "torque"', drive)
    path.write_text(text, encoding="utf-8")
    readme = (pellucid.export(pellucid.open(study.folder)) / "README.md").read_text(encoding="utf-8")
    assert f"The drive gives 2 N*m per {unit} of its command." in readme
