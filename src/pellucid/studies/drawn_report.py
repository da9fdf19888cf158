"""A report that was drawn, and from what: while nothing of it changed, it need not be drawn again."""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from pathlib import Path

from .._atomic import write_text_atomically
from ..recordings.kept_columns import FILE_ENDING
from .study import Study, checksum

PAGE_NAME = "index.html"
"""Name of the report's page in its folder."""

TEMPLATES = Path(__file__).parents[1] / "pages"
"""Folder of the package whose templates and styles the page is made with."""


def drawn_page(study: Study, *, with_pdf: bool) -> Path | None:
    """Return the page of a study's report if it was drawn from what is there now, and is whole; else None.

    Parameters
    ----------
    study : Study
    with_pdf : bool
        Whether figures must be there as PDF, too.
    """
    try:
        told = json.loads(_note(study).read_text(encoding="utf-8"))
        whole = all(checksum(study.report_dir / name) == digest for name, digest in told["files"].items())
        same = told["made_from"] == _made_from(study, with_pdf)
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return None
    return study.report_dir / PAGE_NAME if whole and same and PAGE_NAME in told["files"] else None


def note_drawn(study: Study, page: Path, *, with_pdf: bool) -> None:
    """Note beside a study's results what its report was drawn from, and the checksums of its files.

    Where nothing can be written there is no note, and the next report is drawn.
    """
    if page.parent != study.report_dir:
        return
    files = {path.name: checksum(path) for path in sorted(page.parent.iterdir()) if path.is_file()}
    told = {"made_from": _made_from(study, with_pdf), "files": files}
    with suppress(OSError):
        write_text_atomically(_note(study), json.dumps(told, indent=1) + "\n")


def _note(study: Study) -> Path:
    return study.place("kept") / "report.json"


def _made_from(study: Study, with_pdf: bool) -> str:
    """Return the SHA-256 of all that a report may draw: the study's folder, what commands kept, code and templates."""
    recordings = {path.resolve() for path in study.files()}
    left_out = {_note(study).resolve()}
    more = []
    for folder in dict.fromkeys((study.folder.resolve(), study.made.resolve())):
        for path in sorted(folder.rglob("*")):
            # Kept columns are named after the checksums of recordings, which count already; they may be gigabytes.
            derived = study.report_dir.resolve() in path.parents or path.name.endswith(FILE_ENDING)
            if path.is_file() and not derived and path.resolve() not in recordings | left_out:
                more.append(path)
    more += [path for path in sorted(TEMPLATES.rglob("*")) if path.suffix in (".j2", ".css", ".js")]
    parts = (study.fingerprint(more), str(with_pdf))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
