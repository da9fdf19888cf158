"""The wheel for aarch64, cross-compiled, and run in an emulated Debian: import, a fit, an export, tests of the core."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from pellucid.study.results import ResultRow

ROOT = Path(__file__).parents[2]


def rows() -> Iterator[ResultRow]:
    """Yield whether the wheel runs there. Where a tool is missing it does not run, and the note names the tool."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made, "dist")
        search = [sys.executable, ROOT / "packaging" / "later_pythons.py"]
        later = subprocess.run(search, text=True, check=False, capture_output=True)
        if later.returncode:
            used, failure = {}, "found no Python 3.12 or later to build with"
        else:
            subprocess.run([ROOT / "packaging" / "wheels.sh", later.stdout.strip()], check=True,
                           env={**os.environ, "WHEELS": str(folder), "MACHINES": "aarch64"},
                           stdout=subprocess.DEVNULL)  # fmt: skip
            found = subprocess.run([sys.executable, ROOT / "packaging" / "emulated_root.py", folder], text=True,
                                   check=False, capture_output=True)  # fmt: skip
            used = json.loads(found.stdout) if found.returncode == 0 else {}
            failure = (found.stderr.strip().splitlines() or ["no message"])[-1]
    runs = used.get("machine") == "aarch64" and used["tests_passed"] > 0
    note = failure
    if runs:
        note = (
            f"{used['module']} under {used['emulator']}, Python {used['python']}: import, fit_joint, export; "
            f"{used['tests_passed']} tests of the core passed, in {used['seconds']:.0f} s"
        )
    yield ResultRow("formats.wheel.aarch64.runs", float(runs), "1", "evidence", "heldout", None, note)
