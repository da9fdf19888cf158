"""The core as a CMake package: installed, found and linked by a project that simulates a joint and steps a law."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CMAKE = shutil.which("cmake", path=str(Path(sys.executable).parent)) or shutil.which("cmake")


def run(*command: object) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.skipif(CMAKE is None or shutil.which("c++") is None, reason="not installed: cmake or c++")
def test_a_project_finds_the_installed_core(tmp_path):
    prefix = tmp_path / "prefix"
    run(CMAKE, "-S", ROOT, "-B", tmp_path / "core", f"-DCMAKE_INSTALL_PREFIX={prefix}")
    run(CMAKE, "--install", tmp_path / "core")
    assert (prefix / "share/licenses/pellucid/LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    assert "pellucid 0.1." in run(
        CMAKE, "-S", ROOT / "tests/core/package", "-B", tmp_path / "user", f"-DCMAKE_PREFIX_PATH={prefix}"
    )
    run(CMAKE, "--build", tmp_path / "user")
    without, carried = map(float, run(tmp_path / "user" / "falling").split())
    assert without > 0.3
    assert abs(carried) < 0.01  # while the effort rises to the weight at the rate that the gate allows
