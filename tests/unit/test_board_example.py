"""The project around an exported controller: loops on an emulated Cortex-M4F and on Linux, and their logs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_export import compiled, made_study, on_m4

import pellucid

BOARD = Path(__file__).parents[2] / "examples" / "board"
PERIODS = 10_000


def build(folder: Path, *options: str) -> None:
    tools = Path(sys.executable).parent
    ninja = f"-DCMAKE_MAKE_PROGRAM={tools / 'ninja'}"
    for step in (["-G", "Ninja", ninja, "-S", str(BOARD), "-B", str(folder), *options], ["--build", str(folder)]):
        run = subprocess.run([tools / "cmake", *step], capture_output=True, text=True)
        assert run.returncode == 0, run.stdout + run.stderr


@pytest.fixture(scope="module")
def controller(tmp_path_factory) -> Path:
    return pellucid.export(made_study(tmp_path_factory.mktemp("study")))


@pytest.fixture(scope="module")
def loop(controller, tmp_path_factory) -> Path:
    """The program for Linux."""
    folder = tmp_path_factory.mktemp("loop")
    build(folder, f"-DCONTROLLER={controller}")
    return folder / "loop"


@pytest.mark.nightly
@on_m4
def test_a_microcontroller_runs_the_loop_and_leaves_its_log(controller, tmp_path):
    build(tmp_path / "m4", f"-DCONTROLLER={controller}", f"-DCMAKE_TOOLCHAIN_FILE={BOARD / 'cortex-m4f.cmake'}")
    log = tmp_path / "log.csv"
    run = subprocess.run(
        ["qemu-system-arm", "-machine", "mps2-an386", "-nographic", "-monitor", "none", "-serial", f"file:{log}",
         "-semihosting-config", "enable=on,target=native", "-kernel", str(tmp_path / "m4" / "board.elf")], timeout=300,
    )  # fmt: skip
    assert run.returncode == 0  # no fault, no line lost
    columns = pellucid.read(log)
    np.testing.assert_array_equal(columns["time"], 1000.0 * np.arange(1, PERIODS + 1))
    assert np.ptp(columns["position"]) > 1e5  # a tenth of a radian: the wearer swings it
    assert columns["enable"].all()
    np.testing.assert_array_equal(columns["drive"][1:], columns["effort"][:-1])


@compiled
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a loop of Linux")
def test_a_computer_runs_the_loop_and_leaves_its_log(loop, tmp_path):
    log = tmp_path / "log.csv"
    run = subprocess.run([loop, "1", log], capture_output=True, text=True, timeout=60)
    # A computer that is busy may miss a deadline, and then the supervisor rightly stops the robot.
    assert "lines of the log lost" in run.stdout, run.stderr
    assert " 0 lines of the log lost" in run.stdout
    columns = pellucid.read(log)
    assert len(columns["time"]) == 1000
    assert np.diff(columns["time"]).min() > 0.0


@compiled
def test_the_loop_says_what_it_expects(loop, tmp_path):
    for given in ((), ("abc", "log.csv"), ("-1", "log.csv")):
        run = subprocess.run([loop, *given], capture_output=True, text=True, cwd=tmp_path)
        assert run.returncode == 2
        assert "expected SECONDS LOG.csv" in run.stderr
    assert not list(tmp_path.glob("log.csv"))


def test_a_folder_without_a_controller_is_refused(tmp_path):
    cmake = Path(sys.executable).with_name("cmake")
    ninja = f"-DCMAKE_MAKE_PROGRAM={Path(sys.executable).with_name('ninja')}"
    run = subprocess.run([cmake, "-G", "Ninja", ninja, "-S", BOARD, "-B", tmp_path / "b", f"-DCONTROLLER={tmp_path}"],
                         capture_output=True, text=True)  # fmt: skip
    assert run.returncode != 0
    assert "found no pellucid_controller.h" in run.stderr
