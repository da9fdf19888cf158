"""Where the files of a study lie, without reading study.toml or loading NumPy."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from .._given import require_inside


@dataclass(frozen=True)
class StudyPlace:
    """The folder of a study, and where commands write.

    Attributes
    ----------
    folder : Path
        Folder of the study.
    out : Path or None
        Folder for everything that is written, instead of the study's own, which may be read-only.
    allow_outside : bool
        Whether files outside the study's folder may be read, if study.toml names them or a link leads there.
    """

    folder: Path
    out: Path | None = None
    allow_outside: bool = False

    @property
    def made(self) -> Path:
        """Folder for everything that commands write."""
        return self.folder if self.out is None else self.out

    @property
    def report_dir(self) -> Path:
        """Folder of the report."""
        return self.place("report")

    def place(self, name: str) -> Path:
        """Return the path `name` in the folder `made`; raise a PellucidError if a link leads out of the study."""
        path = self.made / name
        return path if self.out is not None else require_inside(path, self.folder, self.allow_outside, name)


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
