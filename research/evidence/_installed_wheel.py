"""Wheels installed in a root that has Python and nothing else: no compiler, no shell, no network."""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from pellucid.study.results import ResultRow

ROOT = Path(__file__).parents[2]

UNITS = {
    "wheel_bytes": ("MB", 1e-6),
    "pellucid_bytes": ("MB", 1e-6),
    "installed_bytes": ("MB", 1e-6),
    "base_size_bytes": ("MB", 1e-6),
    "install_s": ("s", 1.0),
    "help_first_s": ("s", 1.0),
    "help_s": ("s", 1.0),
    "demo_s": ("s", 1.0),
}
"""Unit of the row and factor of each figure that the check prints."""

NOTES = {
    "wheel_bytes": "both wheels",
    "pellucid_bytes": "of them, installed",
    "installed_bytes": "with every library that they ask for",
    "base_size_bytes": "`pip install pellucid` with every library that it requires",
    "install_s": "pip, from wheels at hand, modules not compiled",
    "help_first_s": "`pellucid --help` for the first time, which compiles modules",
    "help_s": "`pellucid --help` once more",
    "demo_s": "`pellucid demo`, on a machine that did other things too",
}
"""Description of each figure."""


def rows() -> Iterator[ResultRow]:
    """Yield rows of wheels that are built, repaired by auditwheel, and installed in such a root."""
    with tempfile.TemporaryDirectory() as made:
        # A copy, so that neither the checkout's dist/ nor its build folder is touched.
        folder = Path(made, "dist")
        subprocess.run([ROOT / "packaging" / "wheels.sh", sys.executable], check=True, stdout=subprocess.DEVNULL,
                       env={**os.environ, "WHEELS": str(folder), "MACHINES": platform.machine()})  # fmt: skip
        found = subprocess.run([sys.executable, ROOT / "packaging" / "bare_root.py", folder], text=True, check=False,
                               stdout=subprocess.PIPE)  # fmt: skip
        shutil.rmtree(folder)
    ran = found.returncode == 0
    note = "installed without network, compiler and shell; the demo " + ("wrote its page" if ran else "failed")
    yield ResultRow("formats.wheel.runs_without_compiler", float(ran), "1", "evidence", "heldout", None, note)
    for name, value in (json.loads(found.stdout) if ran else {}).items():
        if name in UNITS:
            unit, factor = UNITS[name]
            row = f"formats.wheel.{name.rsplit('_', 1)[0]}"
            yield ResultRow(row, factor * value, unit, "evidence", "heldout", None, NOTES[name])
