"""A law of several joints as C compiles without a warning, and answers bit by bit as recorded on a Cortex-M4F too."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_tree_laws import PERIOD, M, arm

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers import tree_laws
from pellucid.controllers.export import controller_exporter
from pellucid.controllers.export import controller_values as tree_values
from pellucid.controllers.export.c_folder import check_on_host
from pellucid.controllers.export.controller_values import TreeValues, notes_of
from pellucid.controllers.export.microcontroller import measure, missing_tools
from pellucid.controllers.export.tree_folder import SUPERVISOR_VARIANTS, tree_vector, write_tree_folder
from pellucid.controllers.instruments import Instruments
from pellucid.models.tree_card import write_tree_card

COMPILERS = pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is missing")


@pytest.fixture(scope="module")
def values():
    law = tree_laws.transparent(arm())
    return TreeValues(law, ("tree.best.json",), {"tree.best.json": "0" * 64}, notes_of(law.card))


@pytest.fixture(scope="module")
def folder(values, tmp_path_factory):
    return write_tree_folder("arm", values, tmp_path_factory.mktemp("tree") / "controller")


@COMPILERS
def test_it_compiles_and_answers_as_recorded(folder, values):
    steps, wrong = check_on_host(folder)
    assert (steps, wrong) == (len(tree_vector(values).rows), 0)
    header = (folder / "pellucid_controller.h").read_text()
    assert "PELLUCID_JOINTS = 4, PELLUCID_LINKS = 4" in header
    lines = (folder / "test" / "vector_outputs.h").read_text().splitlines()
    said = [int(line.split("{")[1].split("u")[0]) for line in lines if line.startswith("    { ")]
    faults = {_core.FAULTS[word & 0xFF] for word in said}
    assert {"none", "not_finite", "out_of_order", "stopped", "jump", "drive_silent", "power", "overspeed",
            "unexplained", "ringing", "integrity", "force_sensor", "gain"} <= faults  # fmt: skip
    assert {0, M - 1, M} <= {(word >> 8) & 0xFF for word in said if word & 0xFF}


@COMPILERS
def test_python_answers_bit_by_bit_as_c(folder, values):
    """The motion of the vector through the class that Python has, in float."""
    text = (folder / "test" / "vector_outputs.h").read_text().splitlines()
    wanted = [line.split("{")[2].split("}")[0].split(", ") for line in text if line.startswith("    { ")]
    vector = tree_vector(values)
    law = values.law.start(single=True)
    for i, row in enumerate(vector.steps[:90]):
        pushed = np.full(M, row.pushed)
        q = np.array([s.value for s in row.read], float)
        effort = law.step(PERIOD * i, q, interaction=np.float32(pushed))
        got = [f"0x{int(np.float32(x).view(np.uint32)):08x}u" for x in effort]
        assert got == [x.strip() for x in wanted[i]]


@pytest.mark.nightly
@COMPILERS
@pytest.mark.skipif(bool(missing_tools()), reason="no tools for a Cortex-M4F")
def test_a_cortex_m4_answers_bit_by_bit_as_the_host(folder):
    found = measure(folder)
    assert found.wrong == 0
    assert found.steps > 400
    assert 1_000 < found.instructions < 50_000
    assert found.memory <= _core.tree_law_storage(M) + 8


@pytest.mark.nightly
@COMPILERS
def test_motors_that_turn_together_are_exported_too(tmp_path):
    turns = np.eye(M)
    turns[3, 1] = 0.7
    card = arm(turns=tuple(map(tuple, turns.tolist())), motors=((0.0,) * len(_core.TREE_MOTOR_PARAMETER_NAMES),) * M)
    made = write_tree_folder("arm", TreeValues(tree_laws.carried(card), ("x.json",), {}, ()), tmp_path / "c")
    assert check_on_host(made)[1] == 0
    assert "1.0e+00f, /* coupled */" in (made / "pellucid_constants.h").read_text()


def test_numbers_are_the_cards(folder, values):
    constants = (folder / "pellucid_constants.h").read_text()
    for name in values.law.card.names:
        assert f"/* {name} */" in constants
    assert constants.count("/* coulomb_positive ") == 2 * M
    assert len(SUPERVISOR_VARIANTS) == 10


def test_instruments_are_in_the_interface_and_the_readme(folder, tmp_path):
    """What the study does not state is said to be missing; what it states is asked for."""
    readme = (folder / "README.md").read_text()
    assert readme.count("the study states no measurement of its drive") == M
    assert readme.count("the study states no second encoder") == M
    assert readme.count("has no start-up test") == M
    assert "input.joint[k]" not in readme
    header = (folder / "pellucid_controller.h").read_text()
    assert "pellucid_sample drive[PELLUCID_JOINTS];" in header
    assert "pellucid_sample joint[PELLUCID_JOINTS];" in header
    law = tree_laws.carried(arm(), instruments=Instruments(drive=True, joint_encoder=True), start_up=True)
    made = write_tree_folder("arm", TreeValues(law, ("x.json",), {}, ()), tmp_path / "c")
    readme = (made / "README.md").read_text()
    assert "the study states no" not in readme
    assert "tests polarity and gain of one joint after the other" in readme
    assert "input.joint[k]" in readme
    assert "input.drive[k]" in readme
    constants = (made / "pellucid_constants.h").read_text()
    for name in ("drive_expected", "joint_expected"):
        assert constants.count(f"1.0e+00f, /* {name} ") == M


def test_a_study_without_a_card_or_with_another_law_is_told(values, tmp_path):
    class Study:
        name = "arm"
        accept_stale = True

        def card(self, name):
            return tmp_path / name

    with pytest.raises(PellucidError, match="expected one of carried, full, transparent"):
        tree_values.tree_values(Study(), controller="fc")
    with pytest.raises(PellucidError, match=r"tree\.best\.json"):
        tree_values.tree_values(Study())
    write_tree_card(tmp_path / "tree.consistent.json", values.law.card)
    found = tree_values.tree_values(Study(), controller="full", period=2e-3)
    assert found.cards == ("tree.consistent.json",)
    assert found.law.shares[0]["period"] == 2e-3
    assert found.law.kind == "full"
    assert all(watch["test_effort"] > 0.0 for watch in found.law.watches)
    measured = tree_values.tree_values(Study(), instruments=Instruments(drive=True))
    assert [watch["drive_expected"] for watch in measured.law.watches] == [1.0] * M


def test_a_makefile_that_make_would_obey_is_refused(values, tmp_path):
    (tmp_path / "GNUmakefile").write_text("all:\n")
    with pytest.raises(PellucidError, match="GNUmakefile"):
        write_tree_folder("arm", values, tmp_path)


@pytest.mark.parametrize(
    ("measured", "said"),
    [
        ((True, True), "compares the measured effort of each drive with its command"),
        ((True, False), "The drives of elbow are not measured"),
        ((False, False), "No drive is measured"),
    ],
)
def test_an_exported_robot_says_which_drives_are_watched(measured, said, monkeypatch):
    joints = [SimpleNamespace(joint=name, drive=own) for name, own in zip(("shoulder", "elbow"), measured, strict=True)]
    monkeypatch.setattr(controller_exporter, "rig_instruments", lambda joint: joint)
    request = SimpleNamespace(study=SimpleNamespace(rig=SimpleNamespace(joints=joints)))
    assert said in controller_exporter.ArmExporter().describe(request, Path("controller"))
