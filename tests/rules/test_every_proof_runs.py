"""Every benchmark and every proof can be imported with what tests install, and runs at its smallest size."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from research.benchmarks.export import controllers

ROOT = Path(__file__).parents[2]
RESEARCH = ROOT / "research"
NAMES = [(folder, path.stem) for folder in ("benchmarks", "evidence")
         for path in sorted((RESEARCH / folder).glob("*.py")) if path.stem[0].isalpha()]  # fmt: skip
PEERS = ("casadi", "jax", "mujoco", "numba", "pinocchio")
"""Libraries that benchmarks compare with; none of them has to be there."""

COMPARED = [name for folder, name in NAMES
            if "_peers import peer" in (RESEARCH / folder / f"{name}.py").read_text("utf-8")]  # fmt: skip
"""Benchmarks that compare with a peer."""

QUICK_BENCHMARKS = (
    "arm", "emg_estimator", "hill", "identification", "kinematic_tree", "laws", "muscle_calibration", "people", "plant",
    "transfer_function",
)  # fmt: skip
"""Benchmarks that every run tries, in 3 s at most each; all others run with the nightly tests."""

RUN = [
    pytest.param(folder, name, id=f"{folder}.{name}",
                 marks=[] if folder == "benchmarks" and name in QUICK_BENCHMARKS else [pytest.mark.nightly])
    for folder, name in NAMES
]  # fmt: skip
"""What is run: a few benchmarks always; the others and proofs, which take many minutes, with the nightly tests."""

LIMIT_S = 900.0
"""A run that takes longer hangs; the smallest sizes take about a minute at most on an idle machine."""


def run_python(data: Path, *arguments: str) -> subprocess.CompletedProcess:
    settings = {"PELLUCID_DATA": str(data), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env={**os.environ, **settings}, capture_output=True, text=True,
        timeout=LIMIT_S,
    )  # fmt: skip


def without_peers(code: str) -> str:
    return f"import sys; sys.modules.update(dict.fromkeys({PEERS!r})); {code}"


def test_every_file_can_be_imported_without_any_peer(tmp_path):
    imports = "; ".join(f"import research.{folder}.{name}" for folder, name in NAMES)
    done = run_python(tmp_path, "-c", without_peers(imports))
    assert done.returncode == 0, done.stderr


def test_every_controller_of_the_benchmark_of_exports_has_all_its_numbers():
    for name, values in controllers().items():
        assert values.control_law.kind == values.law, name


@pytest.mark.slow
@pytest.mark.parametrize(("folder", "name"), RUN)
def test_the_smallest_size_runs(folder, name, tmp_path, data_folder):
    out = tmp_path / "figures.json"
    done = run_python(data_folder, "-m", f"research.{folder}", name, "--smallest", "--out", str(out))
    assert done.returncode == 0, done.stderr[-4000:]
    told = json.loads(out.read_text(encoding="utf-8"))
    figures = told["figures"]
    if not figures and "not measured" in done.stdout:
        pytest.skip(done.stdout.splitlines()[0])
    assert figures
    names = [figure["name" if folder == "benchmarks" else "id"] for figure in figures]
    assert len(set(names)) == len(names)


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=[] if name in QUICK_BENCHMARKS else [pytest.mark.nightly])
                                  for name in COMPARED])  # fmt: skip
def test_a_peer_that_is_not_installed_is_said_by_name(name, tmp_path, data_folder):
    run = f"import runpy; sys.argv[1:] = [{name!r}, '--smallest', '--out', {str(tmp_path / 'out.json')!r}]; "
    code = without_peers(run + "runpy.run_module('research.benchmarks', run_name='__main__')")
    done = run_python(data_folder, "-c", code)
    assert done.returncode == 0, done.stderr[-4000:]
    assert f"{name}: not compared with" in done.stdout
