"""Where a study lies, what its study.toml says, and what was read of its files so far.

Nothing here loads NumPy or reads study.toml: a report that need not be drawn again is answered from its place alone.
"""

from __future__ import annotations

import hashlib
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from .._given import require_inside

if TYPE_CHECKING:
    from ..files.recording import Recording
    from ..files.stored_channels import ChannelStore
    from .study_file import StudyFile


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


STUDY_FILE = "study.toml"
"""Name of the file that describes a study."""

RIG_FILE = "lab/rig.toml"
"""File of a study's folder that describes its virtual rig, from which `simulate` makes the recordings."""

RESULTS_FILE = "results.json"
"""Name of the file with every figure that the commands printed."""


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
    _: KW_ONLY
    out: Path | None = None
    allow_outside: bool = False

    @property
    def path(self) -> Path:
        """Path of study.toml."""
        return self.folder / STUDY_FILE

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

    def inside(self, file: str | Path, where: str) -> Path:
        """Return a file of the study by its path from the folder.

        Raise a PellucidError, which says `where` the file was named, if it lies outside the folder.
        """
        return require_inside(self.folder / file, self.folder, self.allow_outside, where)


@dataclass(eq=False)
class KeptRecordings:
    """What was read of a study's files, kept for as long as the study is open."""

    recordings: dict[str, Recording] = field(default_factory=dict)  # by name, after all steps
    apart: dict[str, Recording] = field(default_factory=dict)  # before their streams were joined
    digests: dict[Path, str] = field(default_factory=dict)  # SHA-256 of files
    store: ChannelStore | None = None  # holds the samples; made with the first recording


@dataclass(frozen=True, eq=False)
class StudySource(StudyPlace):
    """What recordings are made of: a study's place, what its study.toml says, and which recordings are wanted.

    Attributes
    ----------
    config : StudyFile
        Contents of study.toml, in SI.
    left_out : frozenset of str
        Names of the recordings that this study is without.
    shortest_piece : float or None
        Recordings with cuts are taken as the pieces between them that are at least so long [s]; None: as they are.
    kept : KeptRecordings
        What was read of the files; copies of a study that differ in their other attributes share it.
    """

    config: StudyFile = field(repr=False, kw_only=False)
    left_out: frozenset[str] = field(default=frozenset(), repr=False)
    shortest_piece: float | None = field(default=None, repr=False)
    kept: KeptRecordings = field(default_factory=KeptRecordings, repr=False)

    def digest(self, path: Path) -> str:
        """Return the SHA-256 of a file, computed once."""
        if path not in self.kept.digests:
            try:
                self.kept.digests[path] = checksum(path) if path.is_file() else ""
            except OSError:  # reading the file will report the error
                self.kept.digests[path] = ""
        return self.kept.digests[path]
