"""What a user downloads: source distributions that pip accepts, and a lab that fits the package it is built with."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from collections import Counter
from email.parser import BytesParser
from pathlib import Path, PurePosixPath
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[2]

CONDA_NAMES = {"matplotlib": "matplotlib-base", "lazy_loader": "lazy-loader"}
"""Names of conda-forge that differ from PyPI's."""

BUILD_PROGRAMS = {"pip", "python"}
"""What the recipe needs beside the requirements of the build backend."""

VERSION = """
import sys
from scikit_build_core.build import prepare_metadata_for_build_wheel as prepare
print(prepare(sys.argv[1]))
"""
"""Prints the folder of a wheel's metadata, which pip asks for first; nothing is compiled."""

PACKAGE_FILE = "src/pellucid/__init__.py"
"""A file of the package that a source distribution contains once."""


def build(kind: str, source: Path, out: Path) -> Path:
    """Build a distribution with what is installed here, without a network, and return its file."""
    uv = Path(sys.executable).with_name("uv")
    if not uv.exists():
        pytest.skip("uv is not installed")
    done = subprocess.run([uv, "build", f"--{kind}", "--no-build-isolation", "--offline", "--quiet", "--python",
                           sys.executable, "--out-dir", out, source], capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stderr
    return next(path for path in out.iterdir() if path.suffix in (".gz", ".whl"))


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> dict[str, Path]:
    """Source distributions of both projects."""
    return {name: build("sdist", ROOT / folder, tmp_path_factory.mktemp(name))
            for name, folder in (("pellucid", "."), ("pellucid-lab", "lab"))}  # fmt: skip


def members(path: Path) -> list[tarfile.TarInfo]:
    with tarfile.open(path) as archive:
        return archive.getmembers()


@pytest.mark.parametrize("name", ["pellucid", "pellucid-lab"])
def test_a_source_distribution_contains_no_links_which_pip_refuses(sources, name):
    assert [one.name for one in members(sources[name]) if one.issym() or one.islnk()] == []


@pytest.mark.parametrize("name", ["pellucid", "pellucid-lab"])
def test_a_source_distribution_contains_no_file_twice(sources, name):
    inner = [PurePosixPath(*PurePosixPath(one.name).parts[1:]) for one in members(sources[name]) if one.isfile()]
    package = Counter(str(path).removeprefix("lab/") for path in inner if "src/pellucid/" in str(path))
    assert [path for path, count in package.items() if count > 1] == []
    assert (PACKAGE_FILE in package) == (name == "pellucid")


@pytest.mark.parametrize("name", ["pellucid", "pellucid-lab"])
def test_proofs_and_benchmarks_are_in_no_distribution(sources, name):
    folders = {PurePosixPath(one.name).parts[1] for one in members(sources[name]) if one.isfile()}
    assert "src" in folders
    assert not folders & {"research", "evidence", "benchmarks"}


def test_a_licence_is_a_copy_of_the_first():
    assert (ROOT / "lab/LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    assert not (ROOT / "lab/LICENSE").is_symlink()


def test_the_lab_requires_the_version_it_was_built_with(sources, tmp_path):
    """From a source distribution, so without git, as pip builds it for a user."""
    with tarfile.open(sources["pellucid-lab"]) as archive:
        archive.extractall(tmp_path, filter="data")
    wheel = build("wheel", next(tmp_path.iterdir()), tmp_path / "built")
    with ZipFile(wheel) as archive:
        metadata = next(name for name in archive.namelist() if name.endswith("METADATA"))
        told = BytesParser().parsebytes(archive.read(metadata))
    (required,) = [Requirement(line) for line in told.get_all("Requires-Dist")]
    version = Version(told["Version"])
    assert required.name == "pellucid"
    assert required.specifier.contains(version, prereleases=True)
    assert str(required.specifier) == f"=={version.public}"


def test_numpy_is_not_capped_for_faulty_builds():
    with open(ROOT / "pyproject.toml", "rb") as file:
        required = [Requirement(line) for line in tomllib.load(file)["project"]["dependencies"]]
    (numpy,) = [one for one in required if one.name == "numpy"]
    assert not any(numpy.specifier.contains(f"2.5.{patch}") for patch in (2, 3, 4, 5))
    assert numpy.specifier.contains("2.5.1")
    assert numpy.specifier.contains("3.0")


@pytest.mark.parametrize("tag", [None, "v7.8.9"])
def test_a_version_is_that_of_the_tag_or_without_git_that_of_the_source_distribution(sources, tmp_path, tag):
    with tarfile.open(sources["pellucid"]) as archive:
        archive.extractall(tmp_path, filter="data")
    (source,) = tmp_path.iterdir()
    told = BytesParser().parsebytes((source / "PKG-INFO").read_bytes())["Version"]
    if tag:
        (source / "PKG-INFO").unlink()
        author = ["-c", "user.name=test", "-c", "user.email=test@localhost"]
        for command in (["init", "-q"], ["add", "-A"], [*author, "commit", "-qm", "first"], ["tag", tag]):
            subprocess.run(["git", *command], cwd=source, check=True)
        told = tag[1:]
    # No folder above is asked for its commits.
    alone = {**os.environ, "GIT_CEILING_DIRECTORIES": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", VERSION, tmp_path / "metadata"], cwd=source, env=alone,
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 0, done.stderr
    metadata = tmp_path / "metadata" / done.stdout.split()[-1] / "METADATA"
    assert BytesParser().parsebytes(metadata.read_bytes())["Version"] == told


def recipe_requirements(section: str) -> dict[str, str]:
    """Return the packages of a section of the recipe's requirements, with their versions."""
    recipe = (ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8")
    lines = re.search(rf"^  {section}:\n((?:    - .*\n)+)", recipe, re.MULTILINE)[1]
    parts = [line.removeprefix("    - ").partition(" ") for line in lines.splitlines()]
    return {name: str(Requirement(f"x{version}").specifier) for name, _, version in parts}


@pytest.mark.parametrize(("section", "of"), [("run", "dependencies"), ("host", "requires")])
def test_the_conda_recipe_repeats_the_requirements(section, of):
    with open(ROOT / "pyproject.toml", "rb") as file:
        settings = tomllib.load(file)
    required = map(Requirement, settings["project" if of == "dependencies" else "build-system"][of])
    expected = {CONDA_NAMES.get(each.name, each.name): str(each.specifier) for each in required}
    recipe = recipe_requirements(section)
    assert recipe["python"] == settings["project"]["requires-python"]
    assert {name: version for name, version in recipe.items() if name not in BUILD_PROGRAMS} == expected


def test_the_workflow_of_a_release_is_valid():
    checker = shutil.which("actionlint", path=os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"])))
    if checker is None:
        pytest.skip("no actionlint to check workflows")
    done = subprocess.run([checker, ROOT / ".github/workflows/wheels.yml"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
