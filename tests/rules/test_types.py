"""A type checker finds no error in what computes results and what runs on robots; other rooms are not counted."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

CHECKED_ROOMS = ("numerics", "files", "joint", "controllers")
"""Rooms without errors."""

WITHOUT_ARRAYS = """
[mypy]
python_version = 3.11
check_untyped_defs = True
ignore_missing_imports = True
[mypy-numpy.*,scipy.*]
follow_imports = skip
follow_imports_for_stubs = True
"""
"""Settings without NumPy's own types, which take mypy four fifths of its time: what arrays hold is checked nightly."""

ERROR = re.compile(r"^src/pellucid/(?P<room>\w+)[/.].*: error: ")


def errors_by_room(printed: str) -> dict[str, list[str]]:
    """Return the lines of errors that mypy printed, for each checked room."""
    found: dict[str, list[str]] = {room: [] for room in CHECKED_ROOMS}
    for line in printed.splitlines():
        match = ERROR.match(line)
        if match and match["room"] in found:
            found[match["room"]].append(line)
    return found


def assert_no_errors(folder: Path, *options: str) -> None:
    """Let mypy read the package, and fail with the errors of each checked room."""
    command = [sys.executable, "-m", "mypy", "--cache-dir", str(folder / "cache"), *options, "src/pellucid"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    assert "checked" in done.stdout.splitlines()[-1], done.stdout[-2000:]
    for room, lines in errors_by_room(done.stdout).items():
        assert not lines, f"{room}: {len(lines)} errors:\n" + "\n".join(lines)


@pytest.mark.slow
def test_checked_rooms_have_no_errors_of_types(tmp_path):
    settings = tmp_path / "mypy.ini"
    settings.write_text(WITHOUT_ARRAYS, encoding="utf-8")
    assert_no_errors(tmp_path, "--config-file", str(settings))


@pytest.mark.nightly
def test_checked_rooms_have_no_errors_of_types_and_arrays(tmp_path):
    assert_no_errors(tmp_path)


def test_errors_are_counted_by_room():
    printed = (
        "src/pellucid/joint/a.py:3: error: x  [misc]\nsrc/pellucid/emg/a.py:3: error: y  [misc]\nsrc/x.py:1: note: z\n"
    )
    assert {room: len(lines) for room, lines in errors_by_room(printed).items() if lines} == {"joint": 1}
