"""A law exported as a unit for co-simulation: what FMPy says of it, and how it behaves there."""

import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest
from research.evidence._fmu_replay import PlayedUnit, replay
from test_export import made_study
from typer.testing import CliRunner

import pellucid
from pellucid._errors import PellucidError
from pellucid.cli import app
from pellucid.controllers.export import fmu as module
from pellucid.controllers.export.fmu import describe_unit
from pellucid.controllers.supervisor_faults import FAULT_NAMES

compiled = pytest.mark.skipif(
    not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is not installed"
)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return made_study(tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="module")
def units(study, tmp_path_factory):
    """The same law as FMI 3.0 and 2.0."""
    folder = tmp_path_factory.mktemp("units")
    return {fmi: pellucid.export(study, "fmu", folder / f"law{fmi}.fmu", fmi=fmi) for fmi in (3, 2)}


@pytest.fixture
def played(units):
    unit = PlayedUnit(units[3])
    yield unit
    unit.close()


@compiled
@pytest.mark.parametrize("fmi", [3, 2])
def test_fmpy_finds_no_problem_and_the_vector_is_equal_bit_for_bit(units, fmi):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(units[fmi])) == []
    played = replay(units[fmi])
    assert played.steps > 1000
    assert played.wrong == 0


@compiled
@pytest.mark.parametrize("fmi", [3, 2])
def test_the_functions_have_the_signatures_of_the_standard(units, fmi, tmp_path):
    import fmpy

    with zipfile.ZipFile(units[fmi]) as archive:
        archive.extractall(tmp_path)
    options = ["-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-I.", "-include", f"fmi{fmi}Functions.h"]
    headers = Path(fmpy.__file__).parent / "c-code"
    subprocess.run(["c++", *options, f"-I{headers}", f"fmi{fmi}.cpp"], cwd=tmp_path / "sources", check=True)
    subprocess.run(["c++", *options[:6], f"fmi{fmi}.cpp"], cwd=tmp_path / "sources", check=True)


@compiled
def test_a_unit_stamps_samples_itself_unless_stamps_are_given(played):
    played.unit.enterInitializationMode(startTime=0.0)
    played.unit.exitInitializationMode()
    played.put("position.value", 0.4)
    for i in range(20):
        played.unit.doStep(0.0025 * i, 0.0025)
    assert played.get("steps") == 50
    assert played.get("fault") == 0
    assert played.get("now_us") == 49_000
    played.put("position.valid", False)
    played.unit.doStep(0.05, 0.001)
    assert FAULT_NAMES[played.get("fault")] == "not_finite"


@compiled
def test_names_units_and_faults_are_described(units):
    from fmpy import read_model_description

    described = read_model_description(str(units[3]))
    variables = {v.name: v for v in described.modelVariables}
    assert {"position.value", "drive.valid", "token", "effort", "config.effort_limit", "now_us"} <= set(variables)
    assert variables["effort"].unit == "N*m"
    assert [item.name for item in variables["fault"].declaredType.items] == list(FAULT_NAMES)
    older = {v.name: v for v in read_model_description(str(units[2])).modelVariables}
    assert older["now"].unit == "s"
    assert older["challenge"].type == "Integer"


@compiled
def test_the_same_export_gives_the_same_bytes(study, units, tmp_path):
    assert pellucid.export(study, "fmu", tmp_path / "again.fmu").read_bytes() == units[3].read_bytes()


def test_without_a_compiler_the_unit_has_sources_alone_and_says_so(study, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda tool: None)
    run = CliRunner().invoke(app, ["export", str(study.folder), "--to", "fmu", "--out", str(tmp_path / "a.fmu")])
    assert run.exit_code == 0, run.output
    assert "no binary" in run.output
    names = zipfile.ZipFile(tmp_path / "a.fmu").namelist()
    assert "sources/fmi3.cpp" in names
    assert not any(name.startswith("binaries/") for name in names)
    assert b"No binary" in zipfile.ZipFile(tmp_path / "a.fmu").read("documentation/README.md")
    assert "FMI 3.0" in describe_unit(tmp_path / "a.fmu")


@pytest.mark.parametrize(
    ("options", "said"),
    [({"out": "folder"}, r"NAME\.fmu"), ({"out": "a.fmu", "fmi": 1}, "fmi = 1"), ({"to": "c", "fmi": 2}, "found fmi")],
)
def test_what_is_no_unit_is_refused(study, tmp_path, options, said):
    options = {"to": "fmu"} | options
    out = tmp_path / options.pop("out", "c")
    with pytest.raises(PellucidError, match=said):
        pellucid.export(study, options.pop("to"), out, **options)


def test_a_file_of_others_is_not_replaced(study, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "compile_unit", lambda *given: b"")
    monkeypatch.setattr("shutil.which", lambda tool: None)
    place = tmp_path / "a.fmu"
    place.write_bytes(b"mine")
    with pytest.raises(PellucidError, match=r"found no export of Pellucid, expected controller .*overwrite"):
        pellucid.export(study, "fmu", place)
    pellucid.export(study, "fmu", place, overwrite=True)
    pellucid.export(study, "fmu", place)
