"""The page of several joints that were identified one by one: a table of all, then the sections of each joint."""

from __future__ import annotations

from dataclasses import replace

from ...study.pages.forest import Row, Table
from ...study.pages.page import Page, Section, Tile
from ...study.pages.quantities import typeset_sentence
from ...study.procedures.result import Result
from ...study.procedures.study_page import figure_tables, provenance, study_page
from ...study.study import Study
from . import procedure
from .each_joint_result import EachJointResult
from .joint_answer import headline_error, judged_words
from .joint_page import joint_section
from .joint_result import JointResult
from .joint_views import joint_views
from .spring_result import SpringResult
from .static_postures import PostureResult

MAX_TILES = 6
"""At most so many joints have a tile at the head of the page; the table has all."""


def page(study: Study, result: EachJointResult) -> Page:
    """Build the page of a result."""
    views = joint_views(study)
    why = {**{j: f"shows nothing: found {text}" for j, text in result.resting.items()}, **result.left_out}
    notes = tuple(typeset_sentence(f"{joint}: {text}.") for joint, text in why.items())
    overview = Section("joints", "Joints", (), figure_tables(result, "Joints, each"), notes=notes)
    sections = [section for joint, found in result.joints.items() for section in _sections(views[joint], joint, found)]
    return study_page(
        title=f"{result.study}: identified joints",
        answer=result.answer,
        tiles=_tiles(result),
        sections=(overview, *sections, _provenance(study, result)),
        verdicts=result.verdicts,
    )


def _tiles(result: EachJointResult) -> list[Tile]:
    found = {joint: each for joint, each in result.joints.items() if isinstance(each, JointResult)}
    tiles = []
    for joint, each in list(found.items())[:MAX_TILES]:
        where = judged_words(each) or "what was fitted"
        tiles.append(Tile(f"Error of {joint}", str(headline_error(each)), "%", f"on {where}"))
    return tiles


def _sections(view: Study, joint: str, found: Result) -> list[Section]:
    """Return the sections of a joint, with names that no other joint has."""
    if isinstance(found, JointResult):
        made = [joint_section(view, found)]
    else:
        assert isinstance(found, PostureResult | SpringResult)  # they have short pages
        whole = procedure.page(view, found)
        made = [replace(s, id=f"{joint}-{s.id}", heading=f"{joint}: {s.heading}") for s in whole.sections]
    return [replace(s, drawings=tuple(replace(d, name=f"{joint}-{d.name}") for d in s.drawings)) for s in made]


def _provenance(study: Study, result: EachJointResult) -> Section:
    found = [each for each in result.joints.values() if isinstance(each, JointResult)]
    entries = [("Processing", found[0].filter_note)] if found else []
    rows = tuple(Row((name, digest)) for name, digest in result.checksums.items())
    return provenance(study, entries, Table(("Recording", "SHA-256 of its file"), rows, wide=True))
