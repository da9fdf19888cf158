"""A run says what it skipped and how to have it run, in a line each, not test by test."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import LACKED, skipped_lines

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]


def test_each_thing_that_is_lacking_has_one_line():
    reasons = ["Skipped: no public recordings: neither x nor y"] * 71 + ["Skipped: /data/some.csv is not here"]
    reasons += ["not installed: qemu-system-arm", "Skipped: no browser: none of chromium is installed", "Skipped: rain"]
    lines = skipped_lines(reasons)
    assert [line.split(" skipped")[0] for line in lines] == ["72", "1", "1", "1"]
    assert all(how in line for line, (_, how) in zip(lines, LACKED.values(), strict=False))
    assert lines[-1] == "1 skipped: rain"
    assert skipped_lines([]) == []


def test_a_run_without_recordings_ends_with_what_it_lacked(tmp_path):
    found = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/real/test_datasets_load.py"],
        cwd=ROOT, env={**os.environ, "PELLUCID_DATA": str(tmp_path / "none")}, capture_output=True, text=True,
    )  # fmt: skip
    assert found.returncode == 0, found.stdout + found.stderr
    end = found.stdout.strip().splitlines()[-2]
    assert "skipped for want of the public recordings" in end
    assert "PELLUCID_DATA" in end
    assert "SKIPPED [" not in found.stdout


def test_the_run_on_a_clean_checkout_leaves_nothing_out_and_succeeds():
    """No step depends on the time that is left, and the script ends early only by failing."""
    script = (ROOT / ".ci/run").read_text(encoding="utf-8")
    assert "set -euo pipefail" in script
    assert "SECONDS" not in script
    assert "exit" not in script
