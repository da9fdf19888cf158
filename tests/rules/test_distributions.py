"""What a user downloads: source distributions that pip accepts, and a lab that fits the package it is built with."""

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
