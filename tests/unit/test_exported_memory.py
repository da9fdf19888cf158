"""A stop always wins in every exported controller, and no bit that its memory loses forgets a fault or gives power."""

import shutil
import subprocess
from pathlib import Path

import pytest
from exported import written
from test_export import made_study, worn
from test_export_elbow import study as elbow_study  # noqa: F401
from test_tree_laws import PERIOD, M, arm

from pellucid.controllers import tree_laws
from pellucid.controllers.export import tree_folder
from pellucid.controllers.export.controller_values import TreeValues, joint_values, notes_of
from pellucid.controllers.export.elbow_values import elbow_values
from pellucid.controllers.export.replay_vector import SUPERVISOR_VARIANTS
from pellucid.controllers.export.tree_folder import SUPERVISOR_VARIANTS as TREE_VARIANTS
from pellucid.controllers.export.tree_folder import write_tree_folder

pytestmark = pytest.mark.skipif(not all(map(shutil.which, ("cc", "c++"))), reason="cc or c++ is not installed")

PROGRAM = Path(__file__).with_name("exported_memory.c")

TREE_STRIDE = 3
"""Bits between two that are lost of an arm's controller; 3 and 8 have no common divisor, so that every byte is met."""

FIRST_VARIANT = 16
"""Number of the first of the supervisor's variants in a test vector."""


def broken_promises(folder: Path, **defined: float) -> dict[str, int]:
    """How often a controller of a folder broke each promise."""
    options = [f"-D{name}={value}" for name, value in defined.items()]
    where = [f"-I{folder}", f"-I{folder / 'include'}", f"-I{folder / 'test'}"]
    objects = [folder / "memory.o", folder / "controller.o"]
    subprocess.run(["cc", "-std=c11", "-O2", *options, *where, "-c", PROGRAM, "-o", objects[0]], check=True)
    strict = ["-std=c++17", "-O2", "-ffp-contract=off", "-fno-exceptions", "-fno-rtti"]
    subprocess.run(["c++", *strict, *where, "-c", folder / "pellucid_controller.cpp", "-o", objects[1]], check=True)
    subprocess.run(["cc", *objects, "-lm", "-o", folder / "memory"], check=True)
    told = subprocess.run([folder / "memory"], check=True, capture_output=True, text=True).stdout
    return {name: int(count) for name, count in map(str.split, told.splitlines())}


def assert_kept(promises: dict[str, int]) -> None:
    """No promise is broken, and enough bits were lost."""
    assert promises.pop("tried") > 10_000
    assert promises == dict.fromkeys(promises, 0)
    assert len(promises) == 11


@pytest.mark.parametrize(
    "kind", ["joint", "force_sensor", *(pytest.param(kind, marks=pytest.mark.nightly) for kind in ("worn", "clpc"))]
)
def test_a_stop_wins_and_no_lost_bit_forgets_a_fault(kind, tmp_path, request):
    if kind == "joint":
        (tmp_path / "study").mkdir()
        values = joint_values(made_study(tmp_path / "study"))
    elif kind == "worn":
        values = worn()
    else:
        values = elbow_values(request.getfixturevalue("elbow_study"), kind)
    folder = written(values, tmp_path / "c")
    variant = FIRST_VARIANT + list(SUPERVISOR_VARIANTS).index("law")
    assert_kept(broken_promises(folder, LAW_VARIANT=variant, PERIOD=values.numbers["period"], STRIDE=1))


def test_an_arm_keeps_its_joint_in_doubt_without_power(tmp_path, monkeypatch):
    monkeypatch.setattr(tree_folder, "record_outputs", lambda *_: [])
    law = tree_laws.transparent(arm())
    values = TreeValues(law, ("tree.best.json",), {"tree.best.json": "0" * 64}, notes_of(law.card))
    folder = write_tree_folder("arm", values, tmp_path / "c")
    variant = FIRST_VARIANT + list(TREE_VARIANTS).index("law")
    promises = broken_promises(folder, LAW_VARIANT=variant, PERIOD=PERIOD, STRIDE=TREE_STRIDE, JOINTS=M)
    assert_kept(promises)
