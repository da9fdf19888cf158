"""Registered analysis of a study: ``analysis.toml`` in the folder of study.toml, written by ``pellucid plan``."""

from __future__ import annotations

from pathlib import Path

from ..._atomic import write_text_atomically
from ..._errors import StudyError
from ...study.study import Study
from ..analysis import ANALYSIS_FILE, Analysis
from .assessment_table import AssessmentTable


def registered_files(study: Study) -> list[Path]:
    """Return the file of the registered analysis, if there is one."""
    path = Path(study.folder) / ANALYSIS_FILE
    return [path] if path.is_file() else []


def registered_analysis(study: Study) -> Analysis | None:
    """Return the registered analysis; None if none was registered."""
    found = registered_files(study)
    return Analysis.of(found[0]) if found else None


def register(study: Study) -> str:
    """Write the analysis of [assessment], and return a sentence about it.

    Once there are recordings a registered analysis stays as it is, and none is registered any more.
    """
    own, registered = study.table(AssessmentTable).analysis, registered_analysis(study)
    if registered is not None and not own.deviations(registered):
        return f"{ANALYSIS_FILE} registers this analysis."
    if any(entry.condition is not None for entry in study.config.recordings):
        if registered is None:
            return f"No analysis is registered: {ANALYSIS_FILE} must be written before there are recordings."
        apart = "; ".join(own.deviations(registered))
        return f"{ANALYSIS_FILE} registers another analysis ({apart}). It is not changed, because recordings exist."
    path = Path(study.folder) / ANALYSIS_FILE
    try:
        write_text_atomically(path, own.to_toml())
    except OSError as error:
        raise StudyError(f"{path}: the analysis could not be written: {error.strerror}") from None
    said = "Keep it unchanged: `assess` reports any other analysis as post hoc."
    return f"Registered the analysis in {ANALYSIS_FILE}. {said}"
