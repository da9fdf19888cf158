"""What comes in from other programs, what goes out to them, and what an installation needs.

Studies are proposed for a lab's own files, and logs are audited; formats are read back as their own libraries wrote
them; exports are read by the programs that they are for, and MuJoCo saves and reloads them; an exported servo is
replayed in MuJoCo; wheels are installed where there is Python and nothing else,
and one for another processor runs under emulation.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

PARTS = sized(
    (
        "_init_layouts",
        "_audit_logs",
        "_read_back",
        "_exports_read",
        "_mujoco_reloaded",
        "_mujoco_replay",
        "_installed_wheel",
        "_emulated_wheel",
    ),
    smallest=("_init_layouts", "_audit_logs", "_read_back", "_exports_read", "_mujoco_reloaded"),
)
"""Files of this folder that measure a part each, the quick ones first."""


def rows() -> Iterator[ResultRow]:
    """The rows of every part."""
    for part in PARTS:
        yield from import_module(f"research.evidence.{part}").rows()
