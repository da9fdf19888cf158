"""The report of a study that asks for something else than a joint with friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from ..pages.page import Page, write_page
from ..recordings.study import Study
from .result import Findings
from .run import run_procedure

_DOCUMENTS = {
    "transfer_function": "transfer_function.transfer_page",
    "hinge": "hinge.hinge_page",
    "coupling": "coupling.coupling_page",
    "loaded_swing": "loaded_swing.loaded_swing_page",
    "emg_torque": "emg_torque.calibration_page",
    "isolated_muscle": "isolated_muscle.isolated_page",
    "assessment": "assessment.assessment_page",
}  # each has a function `page`


def write_procedure_report(
    study: Study, found: Findings | None = None, *, on_progress: Callable[[str, float], None] | None = None
) -> Path:
    """Write the report: what was identified, calibrated and assessed, on one page.

    Parameters
    ----------
    study : Study
        Its study.toml has a table that asks for a procedure, for a torque from EMG, or for an assessment.
    found : Findings, optional
        What `identify` (or, in a study without anything to identify, `calibrate` or `assess`) found; found again if
        left out, unless calibration was kept.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        If the study's folder cannot be written.
    PellucidError
        If a recording can no longer be read, or nothing can be identified from them.
    """
    tell = on_progress or (lambda text, share: None)
    asked = [study.config.procedure] if study.config.procedure is not None else []
    if study.config.emg_torque is not None:
        asked.append("emg_torque")
    if study.config.isolated_muscle is not None:
        asked.append("isolated_muscle")
    if study.config.assessment is not None:
        asked.append("assessment")
    pages = []
    for i, name in enumerate(asked):
        run = run_procedure
        kept = None
        if name == "emg_torque":
            from .emg_torque.calibrate import calibrate as run
            from .emg_torque.calibration_file import kept_calibration

            kept = kept_calibration(study)
        elif name == "isolated_muscle":
            from .emg_torque.calibrate import calibrate as run
        elif name == "assessment":
            from .assessment.assess import assess as run
        told = found if i == 0 and found is not None else kept
        if told is None:
            told = run(study, on_progress=lambda text, share, i=i: tell(text, (i + 0.8 * share) / len(asked)))
        tell("drawing", (i + 0.8) / len(asked))
        pages.append(import_module(f".{_DOCUMENTS[name]}", __package__).page(study, told))
    return write_page(Path(study.report_dir), _one_page(pages))


def _one_page(pages: list[Page]) -> Page:
    """All on the first, whose name stays; the others' headlines and sections say what they are of."""
    first, *others = pages
    headlines, sections = [first.headline], list(first.sections)
    for page in others:
        what = page.title.rpartition(": ")[2]
        headlines.append(f"{what[:1].upper()}{what[1:]}: {page.headline}")
        known = {section.heading for section in sections}
        sections += [replace(s, heading=f"{s.heading}: {what}") if s.heading in known else s for s in page.sections]
    tiles = tuple(tile for page in pages for tile in page.tiles)
    return replace(first, headline=" ".join(headlines), tiles=tiles, sections=tuple(sections))
