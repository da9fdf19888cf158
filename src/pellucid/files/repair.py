"""Repair a file that ends badly: keep every whole chunk, and write the ends that its recorder did not."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from .._errors import RecordingError
from .readers.xdf import lost_end
from .xdf_writer import seal_xdf

REPAIRED_ENDINGS = (".xdf",)
"""Endings of files that can be repaired."""

MIN_FREE_FACTOR = 1.05
"""Room that a repaired copy needs on the disk, over the size of the file [1]."""


@dataclass(frozen=True)
class Repair:
    """Result of a repair.

    Attributes
    ----------
    path : Path
        The repaired file.
    lost : str
        What the file lacked; empty for a file that was whole.
    removed : int
        Number of bytes of an incomplete chunk that were removed.
    """

    path: Path
    lost: str
    removed: int

    def line(self) -> str:
        """Return the result in a sentence."""
        if not self.lost:
            return f"{self.path}: whole, nothing to repair"
        return f"{self.path}: repaired: it had {self.lost}; {self.removed} bytes removed"


def repair(path: Path, out: Path | None = None) -> Repair:
    """Write a recording whose recorder was killed, or whose disk was full, as a whole file.

    Parameters
    ----------
    path : Path
        An XDF file of any recorder. It is not changed if there is an `out`.
    out : Path or None
        File to write; None to replace the file at once by the whole one.

    Returns
    -------
    Repair
        What was lacking.

    Raises
    ------
    RecordingError
        If the file is missing or of another format, is damaged before its end, or the disk has no room for it.
    """
    path = Path(path)
    if path.suffix.lower() not in REPAIRED_ENDINGS:
        ending, known = path.suffix or "none", ", ".join(REPAIRED_ENDINGS)
        raise RecordingError(f"{path}: found the ending {ending}, expected {known}")
    if not path.is_file():
        raise RecordingError(f"{path}: no such file")
    lost = lost_end(path)
    target = path if out is None else Path(out)
    if out is not None and target.exists():
        raise RecordingError(f"{target}: found a file there, expected none: name another one with --out")
    needed = MIN_FREE_FACTOR * path.stat().st_size
    free = shutil.disk_usage(target.absolute().parent).free
    if free < needed:
        raise RecordingError(f"{target}: found {free} bytes free on its disk, expected at least {needed:.0f}")
    if out is not None:
        shutil.copyfile(path, target)
    removed = seal_xdf(target) if lost else 0
    return Repair(target, lost, removed)
