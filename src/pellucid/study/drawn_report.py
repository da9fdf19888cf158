"""A report that was drawn, and from what: while nothing of it changed, it need not be drawn again.

Nothing here reads study.toml or loads NumPy: a report that need not be drawn is answered before the study is opened.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from .._atomic import write_text_atomically
from .._errors import PellucidError
from .._given import require_inside, visible_text
from .code_fingerprint import code_fingerprint
from .study_place import StudyPlace, checksum

PAGE_NAME = "index.html"
"""Name of the report's page in its folder."""

TEMPLATES = Path(__file__).parent / "pages"
"""Folder of the package whose templates and styles the page is made with."""

KEPT_COLUMNS_ENDING = ".columns"
"""Ending of the files in which recordings are kept as numbers. Their names hold the checksums of the recordings, which
count already; they may be gigabytes."""


class ReportPlace(StudyPlace):
    """Where a study's report is, and what it may be drawn from."""

    @property
    def note(self) -> Path:
        """File that says what the report was drawn from."""
        return self.place("kept") / "report.json"

    def drawn_lines(self, *, with_pdf: bool) -> tuple[str, ...]:
        """Return the lines that told of the report if it was drawn from what is there now, and is whole; else none.

        Parameters
        ----------
        with_pdf : bool
            Whether figures must be there as PDF, too.
        """
        try:
            told = json.loads(self.note.read_text(encoding="utf-8"))
            recordings = [self.folder / name for name in told["recordings"]]
            for path in recordings:
                require_inside(path, self.folder, False, "a recording")
            whole = all(checksum(self.report_dir / name) == digest for name, digest in told["files"].items())
            same = told["made_from"] == self._made_from(recordings, with_pdf)
            lines = tuple(visible_text(line) for line in told["lines"])
        except (OSError, ValueError, LookupError, TypeError, AttributeError, PellucidError):
            return ()
        return lines if whole and same and PAGE_NAME in told["files"] else ()

    def note_drawn(self, page: Path, lines: Iterable[str], recordings: Iterable[Path], *, with_pdf: bool) -> None:
        """Save the sources of a report and the checksums of its files with the study's results.

        `lines` tell of the report, and `recordings` are the files that study.toml names. If one lies outside the
        study's folder, or nothing can be written, the next report is drawn again, because new files elsewhere that
        match a pattern would not be detected.
        """
        if page.parent != self.report_dir:
            return
        named = list(recordings)
        files = {path.name: checksum(path) for path in sorted(page.parent.iterdir()) if path.is_file()}
        told = {
            "made_from": self._made_from(named, with_pdf),
            "files": files,
            "lines": list(lines),
            "recordings": [os.path.relpath(path, self.folder) for path in named],
        }
        with suppress(OSError):
            write_text_atomically(self.note, json.dumps(told, indent=1) + "\n")

    def _made_from(self, recordings: Iterable[Path], with_pdf: bool) -> str:
        """Return the SHA-256 of all that a report may draw: the study's folder, recordings, code and templates."""
        found = {path.resolve() for path in recordings}
        for folder in dict.fromkeys((self.folder.resolve(), self.made.resolve())):
            found |= {path.resolve() for path in folder.rglob("*") if self._is_drawn_from(path)}
        found |= {path for path in TEMPLATES.rglob("*") if path.suffix in (".j2", ".css", ".js")}
        # Page and lines name the folders as they were given, in commands to paste.
        parts = [code_fingerprint(), str(with_pdf), str(self.folder), str(self.report_dir)]
        # relpath also works for a file outside the study's folder.
        parts += sorted(f"{os.path.relpath(path, self.folder)} {checksum(path)}" for path in found)
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()

    def _is_drawn_from(self, path: Path) -> bool:
        """Return whether a path in the study's folder is a file that a report may draw."""
        derived = self.report_dir.resolve() in path.parents or path.name.endswith(KEPT_COLUMNS_ENDING)
        return path.is_file() and not derived and path.resolve() != self.note.resolve()
