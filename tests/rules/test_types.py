"""A type checker reads what others build on: its errors may only fall, and a room without a number here has none."""

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

ALLOWED: dict[str, int] = {"controllers": 20, "joint": 102}
"""Errors that mypy still finds in a room. Lower a number when its room improves."""

ALLOWED_WITHOUT_ARRAYS: dict[str, int] = {"controllers": 19, "joint": 84}
"""Errors that mypy still finds in a room where it knows nothing of NumPy's and SciPy's own types."""

CHECKED_ROOMS = ("numerics", "files", "models", "live", "start", "joint", "controllers")
"""Rooms whose errors are counted: what every domain builds on, and what runs on a robot."""

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
    """Return the lines of errors that mypy printed, by room."""
    found: dict[str, list[str]] = {}
    for line in printed.splitlines():
        match = ERROR.match(line)
        if match and match["room"] in CHECKED_ROOMS:
            found.setdefault(match["room"], []).append(line)
    return found


def assert_no_more_errors(folder: Path, allowed: dict[str, int], *options: str) -> None:
    """Let mypy read the package, and compare the errors of each room with those that are allowed."""
    command = [sys.executable, "-m", "mypy", "--cache-dir", str(folder / "cache"), *options, "src/pellucid"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    assert "checked" in done.stdout.splitlines()[-1], done.stdout[-2000:]
    found = errors_by_room(done.stdout)
    more = {
        room: f"{len(lines)} errors, allowed {allowed.get(room, 0)}:\n" + "\n".join(lines)
        for room, lines in found.items()
        if len(lines) > allowed.get(room, 0)
    }
    assert not more, "\n".join(f"{room}: {text}" for room, text in more.items())


@pytest.mark.slow
def test_no_room_has_more_errors_of_types_than_before(tmp_path):
    settings = tmp_path / "mypy.ini"
    settings.write_text(WITHOUT_ARRAYS, encoding="utf-8")
    assert_no_more_errors(tmp_path, ALLOWED_WITHOUT_ARRAYS, "--config-file", str(settings))


@pytest.mark.nightly
def test_no_room_has_more_errors_of_types_and_arrays_than_before(tmp_path):
    assert_no_more_errors(tmp_path, ALLOWED)


def test_errors_are_counted_by_room():
    printed = (
        "src/pellucid/joint/a.py:3: error: x  [misc]\nsrc/pellucid/emg/a.py:3: error: y  [misc]\nsrc/x.py:1: note: z\n"
    )
    assert {room: len(lines) for room, lines in errors_by_room(printed).items()} == {"joint": 1}


def test_rooms_without_errors_have_no_number():
    assert Counter(ALLOWED.values())[0] == Counter(ALLOWED_WITHOUT_ARRAYS.values())[0] == 0
