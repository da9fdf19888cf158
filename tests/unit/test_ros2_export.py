"""A law exported as a package for ros2_control: its files, and its behaviour in a simulated hardware loop."""

import ast
import shutil
from xml.etree import ElementTree

import pytest
from research.evidence._ros2_loop import play
from test_export import made_study
from typer.testing import CliRunner

import pellucid
from pellucid._errors import PellucidError
from pellucid.cli import app
from pellucid.controllers.export.ros2_package import LABEL, package_name

compiled = pytest.mark.skipif(
    not all(map(shutil.which, ("make", "cc", "c++"))), reason="make, cc or c++ is not installed"
)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return made_study(tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="module")
def package(study, tmp_path_factory):
    return pellucid.export(study, "ros2_control", tmp_path_factory.mktemp("package") / "made")


@compiled
def test_the_controller_compiles_and_replays_the_vector_bit_for_bit(package, tmp_path):
    played = play(package, tmp_path)
    assert played.steps > 1000
    assert played.wrong == 0
    assert played.faults == played.reached > 15
    assert played.refused
    assert played.activation
    assert played.reset
    assert played.reference


def test_the_package_has_what_ros_expects(package):
    name = package_name("compensation")
    files = {path.relative_to(package).as_posix() for path in package.rglob("*") if path.is_file()}
    assert {
        "package.xml", "CMakeLists.txt", "README.md", f"{name}.xml", f"src/{name}_parameters.yaml",
        "src/controller.cpp",
        f"include/{name}/controller.hpp", "launch/mock.launch.py", "config/controllers.yaml", "description/mock.urdf",
        "controller/pellucid_controller.cpp", "controller/include/pellucid/supervisor.hpp",
    } <= files  # fmt: skip
    for path in ("package.xml", f"{name}.xml", "description/mock.urdf"):
        ElementTree.parse(package / path)
    ast.parse((package / "launch" / "mock.launch.py").read_text(encoding="utf-8"))
    plugin = ElementTree.parse(package / f"{name}.xml").getroot()
    assert plugin.find("class").get("base_class_type") == "controller_interface::ChainableControllerInterface"
    readme = (package / "README.md").read_text(encoding="utf-8")
    assert LABEL in readme.replace("**", "")
    assert "Jazzy" in readme


def test_the_parameters_are_those_of_the_law_with_identified_defaults(package):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    (path,) = package.glob("src/*_parameters.yaml")
    (parameters,) = yaml.safe_load(path.read_text(encoding="utf-8")).values()
    assert parameters["joint"]["default_value"] == "elbow"
    assert parameters["config"]["effort_limit"]["default_value"] == 5.0
    assert isinstance(parameters["config"]["power_limit"]["default_value"], float)
    assert parameters["reference_limit"]["default_value"] == 0.0

    def leaves(table):
        for entry in table.values():
            yield from [entry] if "type" in entry else leaves(entry)

    for entry in leaves(parameters):
        assert entry["description"]
        kind = {"string": str, "double": float, "bool": bool, "int": int}[entry["type"]]
        assert isinstance(entry["default_value"], kind)


def test_the_command_says_what_has_been_tried(study, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda tool: None)
    out = tmp_path / "r"
    run = CliRunner().invoke(app, ["export", str(study.folder), "--to", "ros2_control", "--out", str(out)])
    assert run.exit_code == 0, run.output
    assert "not yet run under ROS 2" in " ".join(run.output.split())
    pellucid.export(study, "ros2_control", out)
    (out / "pellucid.json").unlink()
    with pytest.raises(PellucidError, match="overwrite"):
        pellucid.export(study, "ros2_control", out)


def test_sources_of_others_are_not_replaced(study, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda tool: None)
    own = tmp_path / "src" / "controller.cpp"
    own.parent.mkdir()
    own.write_text("mine", encoding="utf-8")
    with pytest.raises(PellucidError, match="found src, which an export of Pellucid did not write"):
        pellucid.export(study, "ros2_control", tmp_path)
    assert own.read_text(encoding="utf-8") == "mine"


def test_outputs_of_an_earlier_export_are_removed(study, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda tool: None)
    pellucid.export(study, "ros2_control", tmp_path)
    outputs = tmp_path / "controller" / "test" / "vector_outputs.h"
    outputs.write_text("of another law", encoding="utf-8")
    pellucid.export(study, "ros2_control", tmp_path)
    assert not outputs.exists()
