"""Controllers of a virtual elbow, exported for the programs of other people, and replayed there."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from pellucid.study.results import ResultRow

PARTS = ("_fmu_replay", "_ros2_loop", "_targets")
"""Files of this folder that measure a part each, of the exports of one identified elbow."""


def rows() -> Iterator[ResultRow]:
    """The rows of every part."""
    with tempfile.TemporaryDirectory() as scratch:
        elbow = Path(scratch, "elbow")
        for arguments in (["init", elbow, "--rig", "able-elbow"], ["simulate", elbow], ["identify", elbow]):
            subprocess.run([sys.executable, "-m", "pellucid", *arguments], check=True, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL)  # fmt: skip
        for part in PARTS:
            yield from import_module(f"research.evidence.{part}").rows(elbow, Path(scratch))
