"""The board of foreign laws: every run of a folder, so that versions of a law and of Pellucid are compared."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from pellucid.study.results import ResultRow, read_rows, write_rows

from .foreign_law import ForeignLaw
from .strategies import SIMPLE_RIVALS
from .task_ranking import TaskRanking

BOARD_COMMAND = "rank"
"""Command that writes the board."""

BOARD_FILE = "board.json"
"""File of the board in the folder of a ranking."""


@dataclass(frozen=True)
class BoardEntry:
    """A foreign law's place in one task of one run."""

    law: str
    checksum: str  # SHA-256 of its file when it was read
    task: str
    place: int
    of: int
    share: float | None  # median torque over the robot's without power; None if it was stopped [1]
    pairs: int
    seed: int
    version: str  # version of Pellucid


def add_to_board(
    out: Path, tasks: Sequence[TaskRanking], pairs: int, seed: int, laws: Sequence[ForeignLaw]
) -> tuple[BoardEntry, ...]:
    """Add a run to the board of a folder, replacing an earlier equal run, and return all entries."""
    path = out / BOARD_FILE
    entries = [BoardEntry(**json.loads(row.note)) for row in read_rows(path)] if path.exists() else []
    for law in laws:
        for task in tasks:
            if law.name in task.controllers:
                place = task.controllers.index(law.name)
                share = float(np.median(task.over(SIMPLE_RIVALS[task.task][0])[:, place]))
                entries.append(
                    BoardEntry(
                        law.path.name, law.checksum, task.task, place + 1, len(task.controllers),
                        share if np.isfinite(share) else None, pairs, seed, version("pellucid"),
                    )
                )  # fmt: skip
    kept = {(e.law, e.checksum, e.task, e.pairs, e.seed, e.version): e for e in entries}
    if kept:
        write_rows(path, BOARD_COMMAND, [
            ResultRow(f"board.{i}", e.share, "1", BOARD_COMMAND, "simulated", e.checksum, json.dumps(asdict(e)))
            for i, e in enumerate(kept.values())
        ])  # fmt: skip
    return tuple(kept.values())


def share_over_before(entries: Sequence[BoardEntry], entry: BoardEntry) -> float | None:
    """Return an entry's share over that of the same law's file or Pellucid's version before it [1].

    Only the same task with the same pairs of people and robots is compared. None if there is nothing before, or one of
    both was stopped.
    """
    before = [
        e
        for e in entries[: list(entries).index(entry)]
        if (e.law, e.task, e.pairs, e.seed) == (entry.law, entry.task, entry.pairs, entry.seed)
    ]
    if not before or before[-1].share is None or entry.share is None:
        return None
    return entry.share / before[-1].share
