"""A wheel from a source distribution: how long its units take to compile, and that a later Python takes it."""

import os
import runpy
import subprocess
import sys
import tarfile
from pathlib import Path
from zipfile import ZipFile

import pytest

pytestmark = pytest.mark.nightly

ROOT = Path(__file__).parents[2]

MAX_UNIT_SECONDS = 20.0
"""CPU time of the compiler for one unit. The longest takes about 11 s; a whole build waits for it."""

COMPILER = """
import resource, subprocess, sys
status = subprocess.call(sys.argv[2:])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
with open(sys.argv[1], "a") as log:
    print(used.ru_utime + used.ru_stime, sys.argv[sys.argv.index("-o") + 1], file=log)
sys.exit(status)
"""
"""Runs a compiler and appends its CPU time [s] and what it made to a file."""

USE = runpy.run_path(str(ROOT / "packaging" / "wheel_use.py"))
"""What is done with a wheel, here and in an emulated root."""

later_pythons = runpy.run_path(str(ROOT / "packaging" / "later_pythons.py"))["later_pythons"]


def run(*command: object, **settings: object) -> str:
    """Run a command and return what it printed."""
    done = subprocess.run([str(word) for word in command], cwd=ROOT, capture_output=True, text=True, **settings)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


@pytest.fixture(scope="module")
def uv() -> Path:
    """The installer in this environment."""
    path = Path(sys.executable).with_name("uv")
    if not path.exists():
        pytest.skip("uv is not installed")
    return path


@pytest.fixture(scope="module")
def built(uv, tmp_path_factory) -> tuple[Path, dict[str, float]]:
    """The wheel of the oldest Python from 3.12 on, or of this one, and each unit's CPU time [s].

    It is built from a source distribution, without git.
    """
    folder = tmp_path_factory.mktemp("wheel")
    log, compiler = folder / "log", folder / "compiler.py"
    compiler.write_text(COMPILER, encoding="utf-8")
    python = next(iter(later_pythons().values()), sys.executable)
    launcher = f"cmake.define.CMAKE_CXX_COMPILER_LAUNCHER={sys.executable};{compiler};{log}"
    run(uv, "build", "--sdist", "--out-dir", folder, ".")
    with tarfile.open(next(folder.glob("*.tar.gz"))) as archive:
        archive.extractall(folder / "source", filter="data")
    (source,) = (folder / "source").iterdir()
    alone = {**os.environ, "GIT_CEILING_DIRECTORIES": str(folder)}
    run(uv, "build", "--wheel", "--python", python, "--out-dir", folder, "--config-setting", launcher,
        "--config-setting", f"build-dir={folder / 'build'}", source, env=alone)  # fmt: skip
    seconds = {name: float(used) for used, name in (line.split() for line in log.read_text("utf-8").splitlines())}
    return next(folder.glob("*.whl")), seconds


def test_no_unit_takes_long_to_compile(built):
    seconds = built[1]
    assert sum("_core.dir/bindings" in name for name in seconds) > 20
    assert {name: used for name, used in seconds.items() if used > MAX_UNIT_SECONDS} == {}


def test_the_types_of_the_core_are_in_the_wheel(built):
    names = ZipFile(built[0]).namelist()
    assert names.count("pellucid/_core.pyi") == 1


def test_a_later_python_imports_the_wheel_of_an_earlier_one(uv, built, tmp_path):
    pythons = [*later_pythons().values()]
    if not pythons:
        pytest.skip("not installed: Python 3.12 or later")
    assert "-cp312-abi3-" in built[0].name
    python = tmp_path / "venv" / "bin" / "python"
    run(uv, "venv", "--python", pythons[-1], tmp_path / "venv")
    run(uv, "pip", "install", "--python", python, built[0], "pytest")
    alone = {**os.environ, "PYTHONPATH": str(ROOT / "lab" / "src")}  # tests share a study that the lab records
    run(python, "-P", "-c", USE["FIT"], env=alone)
    run(python, "-P", "-m", "pytest", "-q", "-p", "no:cacheprovider", *USE["CORE_TESTS"], env=alone)
