"""A type checker reads the package: the errors of a room may only fall, and a room without a number here has none."""

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

ALLOWED: dict[str, int] = {
    "demonstration": 7,
    "deployment": 35,
    "drawing": 5,
    "lab": 122,
    "papers": 198,
    "procedures": 491,
    "ranking": 12,
    "studies": 100,
}
"""Errors that mypy still finds in a room. Lower a number when its room improves."""

ERROR = re.compile(r"^src/pellucid/(?P<room>\w+)[/.].*: error: ")


def errors_by_room(printed: str) -> dict[str, list[str]]:
    """Return the lines of errors that mypy printed, by room."""
    found: dict[str, list[str]] = {}
    for line in printed.splitlines():
        match = ERROR.match(line)
        if match:
            found.setdefault(match["room"], []).append(line)
    return found


@pytest.mark.slow
def test_no_room_has_more_errors_of_types_than_before(tmp_path):
    command = [sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path), "src/pellucid"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    assert "checked" in done.stdout.splitlines()[-1], done.stdout[-2000:]
    found = errors_by_room(done.stdout)
    more = {
        room: f"{len(lines)} errors, allowed {ALLOWED.get(room, 0)}:\n" + "\n".join(lines)
        for room, lines in found.items()
        if len(lines) > ALLOWED.get(room, 0)
    }
    assert not more, "\n".join(f"{room}: {text}" for room, text in more.items())


def test_errors_are_counted_by_room():
    printed = (
        "src/pellucid/fit/a.py:3: error: x  [misc]\nsrc/pellucid/cli.py:3: error: y  [misc]\nsrc/x.py:1: note: z\n"
    )
    assert {room: len(lines) for room, lines in errors_by_room(printed).items()} == {"fit": 1, "cli": 1}


def test_rooms_without_errors_have_no_number():
    assert Counter(ALLOWED.values())[0] == 0
