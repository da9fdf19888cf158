"""A study: a folder with study.toml, the recordings that it names, and their results.

Where the files of a study lie, without reading study.toml or loading NumPy.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from .._errors import IdentificationError, RecordingError, StudyError
from .._given import require_folder, require_inside, require_path
from .results import read_rows
from .study_place import RESULTS_FILE, STUDY_FILE, StudySource, checksum

if TYPE_CHECKING:
    from ..files.recording import Recording
    from .study_fields import Table
    from .study_file import ChannelSpec, Model, OneJoint, Processing, RigJoint, SeveralJoints, StudyFile

INSTRUMENTS_KEY = "instruments"
"""Key of a joint's table that only controllers use: it may be stated after the joint was identified."""


def without_keys(table: object, *left_out: str) -> object:
    """Return a table without the keys `left_out`, also in the tables that it contains."""
    if isinstance(table, Mapping):
        return {key: without_keys(value, *left_out) for key, value in table.items() if key not in left_out}
    return [without_keys(each, *left_out) for each in table] if isinstance(table, (list, tuple)) else table


@dataclass(frozen=True, eq=False)
class Study(StudySource):
    """A study's folder and the contents of its study.toml.

    Attributes
    ----------
    accept_stale : bool
        Whether a model card may be used that was made from an earlier state of the study.
    found : dict
        Results that procedures need more than once.

    The other attributes are those of `StudySource`.
    """

    accept_stale: bool = False
    found: dict = field(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        """Name of the study, which begins every figure's id."""
        return self.config.name

    @property
    def rig(self) -> OneJoint | RigJoint | SeveralJoints:
        """The machine: its joint, or several joints in `joints`."""
        return self.config.rig

    @property
    def processing(self) -> Processing:
        """Processing of samples before a regression."""
        return self.config.processing

    @property
    def model(self) -> Model:
        """The model that is identified."""
        return self.config.model

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks that the report repeats."""
        return self.config.notes

    def has_table(self, name: str) -> bool:
        """Return whether study.toml has the table of a procedure, such as ``"tree"``."""
        return name in self.config.procedures

    def find_table(self, kind: type[Table]) -> Table | None:
        """Return the table of a class that asks for a procedure; None where study.toml has none."""
        return self.config.find_table(kind)

    def table(self, kind: type[Table]) -> Table:
        """Return the table of a class that asks for a procedure.

        Parameters
        ----------
        kind : type of ProcedureTable
            Class of the table, as the procedure's own folder defines it.

        Raises
        ------
        IdentificationError
            If study.toml has no such table.
        """
        found = self.find_table(kind)
        if found is None:
            name = kind.table_name()
            raise IdentificationError(f"{self.folder}: found no table [{name}] in study.toml, expected one")
        return found

    @property
    def models_dir(self) -> Path:
        """Folder for model cards."""
        return self.place("models")

    @property
    def results_path(self) -> Path:
        """File with every figure that the commands printed."""
        return self.made / RESULTS_FILE

    def kept_path(self, procedure: str) -> Path:
        """Return the file with a procedure's complete result, from which the report draws its figures."""
        return self.place("kept") / f"{procedure}.npz"

    def cards(self, pattern: str = "*.json") -> tuple[Path, ...]:
        """Return the model cards whose names match, in order of name; `models_dir` has precedence."""
        found = {path.name: path for path in sorted((self.folder / "models").glob(pattern))}
        found = {name: self.inside(Path("models") / name, f"model card {name}") for name in found}
        found |= {path.name: path for path in self.models_dir.glob(pattern) if self.out is not None}
        return tuple(found[name] for name in sorted(found))

    def card(self, name: str) -> Path:
        """Return the path of the model card with the file name `name`, whether or not it exists."""
        where = f"model card {name}"
        if self.out is not None:
            own = require_inside(self.models_dir / name, self.out, self.allow_outside, where)
            if own.is_file():
                return own
        return self.inside(Path("models") / name, where)

    def files(self) -> tuple[Path, ...]:
        """Return every file that study.toml names among the recordings, once."""
        from .recording_steps import every_file

        return tuple(dict.fromkeys(every_file(self)))

    def fingerprint(self, more: Iterable[Path] = ()) -> str:
        """Return the SHA-256 of all from which a procedure computes its result.

        That is Pellucid's own code, the tables of study.toml without a joint's instruments, which only controllers
        use, the files of all recordings, and `more` files.
        """
        from .code_fingerprint import code_fingerprint

        stated = self.config.model_dump(exclude_defaults=True, warnings=False)
        stated["rig"] = without_keys(stated["rig"], INSTRUMENTS_KEY)
        digests = {path: self.digest(path) for path in self.files()}
        # Cards may change while a study is open, so they are read again. Recordings are read once.
        digests |= {path: checksum(path) if path.is_file() else "" for path in more}
        parts = [code_fingerprint(), json.dumps(stated, default=str)]
        # relpath also works for a file outside the study's folder.
        parts += [f"{os.path.relpath(path, self.folder)} {digest}" for path, digest in digests.items()]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()

    def recordings(
        self, use: str | None = None, *, on_progress: Callable[[str, float], None] = lambda text, share: None
    ) -> tuple[Recording, ...]:
        """Return the recordings in the order of study.toml; each file is read once.

        Parameters
        ----------
        use : str or None
            ``"fit"`` or ``"validate"``; None for all.
        on_progress : callable, optional
            Function that is called before each recording, with a text and the share of recordings done, 0 to 1.

        Raises
        ------
        RecordingError
            If a file is missing or unreadable, or lacks a column. The message names the file and the channel.
        """
        from .recording_steps import prepared_recordings

        return prepared_recordings(self, use, on_progress)

    def recording(self, name: str) -> Recording:
        """Return one recording by its name.

        Raises
        ------
        RecordingError
            If study.toml names no such recording, or it cannot be read.
        """
        from .recording_steps import prepared_recording

        return prepared_recording(self, name)

    def without(self, names: Iterable[str]) -> Study:
        """Return the same study without the recordings `names`."""
        return replace(self, left_out=self.left_out | frozenset(names))

    def in_pieces(self, shortest: float) -> Study:
        """Return the same study, whose recordings with cuts are taken as the pieces between them of `shortest` [s]."""
        return replace(self, shortest_piece=shortest)

    def apart(self, name: str) -> Recording:
        """Return a recording as it was before streams were joined."""
        return self.kept.apart[name]

    def rejoined(self, name: str, clocks: Mapping[str, tuple[float, float]]) -> Recording:
        """Return a recording with its streams joined by the offsets [s] and drifts of their `clocks`."""
        from .recording_steps import join_streams

        return join_streams(self.apart(name), self, self.config.entry_of(name), clocks)

    def specs_of(self, recording: Recording) -> dict[str, ChannelSpec]:
        """Return the entries of study.toml for a recording's channels."""
        entry = self.config.entry_of(recording.name)
        if entry is None:
            return self.config.channels
        streams = {n: c for stream in entry.streams for n, c in self.config.joined_channels(stream).items()}
        return {**streams, **self.config.channels_of(entry)}

    def processing_of(self, recording: Recording) -> Processing:
        """Return the processing of a recording's samples before a regression."""
        return self.config.processing_of(recording.name)


def open_folder(
    folder: str | os.PathLike,
    model: Callable[[Collection[str] | None], type[StudyFile]],
    *,
    out: str | os.PathLike | None = None,
    allow_outside: bool = False,
) -> Study:
    """Open a study's folder. Recordings are read only when they are used."""
    from .study_file import parse_study_file

    folder = require_path(folder, "open: folder")
    require_folder(folder, f"a study: the folder with a {STUDY_FILE} in it", StudyError)
    if out is not None:
        require_folder(Path(out), "a folder to write to")
    path = require_inside(folder / STUDY_FILE, folder, allow_outside, str(folder))
    config = parse_study_file(path, model)
    if out is not None:
        _require_own_results(Path(out), folder, config.name)
    return Study(folder, config, out=None if out is None else Path(out), allow_outside=allow_outside)


def _require_own_results(out: Path, folder: Path, name: str) -> None:
    """Refuse a folder for results that belongs to another study or has its results: their cards have equal names."""
    if out.resolve() == folder.resolve():
        return
    if (out / STUDY_FILE).exists():
        raise StudyError(f"{out}: found another study, expected a folder for the results of {folder}")
    try:
        rows = read_rows(out / RESULTS_FILE) if (out / RESULTS_FILE).is_file() else []
    except RecordingError:
        rows = []
    others = {row.id.partition(".")[0] for row in rows} - {name}
    if others:
        raise StudyError(
            f"{out}: found results of {', '.join(sorted(others)[:5])}, expected those of {name} or none; name another "
            "folder to write to"
        )
