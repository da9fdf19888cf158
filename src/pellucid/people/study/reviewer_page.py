"""Page for a reviewer of a certificate: what was stated before the data, what was found, and what was left out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ..._printed_command import printed_command
from ...study.pages.forest import Row, Table
from ...study.pages.page import Page, Section, Tile, write_page
from ...study.pages.quantities import typeset_cell, typeset_sentence
from ...study.procedures.procedure import quiet
from ...study.procedures.study_page import provenance, study_page
from ...study.study import checksum
from ..comparison import HIDDEN_SHARE, MIN_PEOPLE
from ..equivalence import FAR_MARGIN_COUNT
from . import assessment_tables as tables
from .assessment_page import certificate_answer
from .assessment_result import AssessmentResult, kept_certificates
from .assessment_table import AssessmentTable
from .certified_rows import TEST_ASSUMPTIONS, TEST_NAMES, certificate_remarks, certificate_sentences, people_text
from .pointing_faults import REASON_WORDS
from .statements import p_statement

if TYPE_CHECKING:
    from ...study.study import Study

PAGE_FOLDER = "certificate"
"""Folder of the page, in the study's folder or in the one for what is made."""


def write_certificate(study: Study, *, on_progress: Callable[[str, float], None] | None = None) -> Path:
    """Write the page for a reviewer, from what `assess` kept if it is fresh, and return its path.

    Parameters
    ----------
    study : Study
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Path
        ``certificate/index.html``: one file without outside references, the same bytes for the same folder.

    Raises
    ------
    StudyError
        If the study states no margins.
    """
    found = kept_certificates(study, "margins to certify", on_progress or quiet)
    return write_page(Path(study.place(PAGE_FOLDER)), reviewer_page(study, study.table(AssessmentTable), found))


def reviewer_page(study: Study, spec: AssessmentTable, found: AssessmentResult) -> Page:
    """Build the page: verdicts, protocol, margins, assumptions, results, sensitivity, exclusions, provenance."""
    verdicts = [(each.condition, each.certificate.verdict) for each in found.certified]
    command = printed_command("certificate", study.folder)
    following = (f"Make this page again: `{command}`.",)
    return study_page(
        f"{found.study}: certificate",
        " ".join(map(typeset_sentence, certificate_sentences(found))),
        [Tile(condition, verdict, "", p_statement(each.certificate.p_value))
         for each, (condition, verdict) in zip(found.certified, verdicts, strict=True)],
        [_result(found), _protocol(study, spec, found), _margins(spec, found), _assumptions(found), _sensitivity(found),
         _exclusions(found), provenance(study, [("Made again by", command)], _checksums(study, found))],
        answer=certificate_answer(found, following),
    )  # fmt: skip


def _table(heads: tuple[str, ...], rows: list[tuple], caption: str, words: int = 1) -> Table:
    made = tuple(Row(tuple(typeset_cell(cell) for cell in row)) for row in rows)
    # A table of words alone is as narrow as the screen, where one that fills the page would go on behind its edge.
    return Table(heads, made, frozenset(range(words, len(heads))), caption, words < len(heads))


def _result(found: AssessmentResult) -> Section:
    own = tables.certificate_tables(found)[0]
    return Section(
        "verdict",
        "Verdict",
        tables=(_table(own.heads, list(own.rows), f"{own.title.rstrip('.')}.", 2),),
        notes=tuple(map(typeset_sentence, certificate_remarks(found))),
    )


def _protocol(study: Study, spec: AssessmentTable, found: AssessmentResult) -> Section:
    people = len(found.participants) + len(found.without)
    look = "at its end only" if spec.look is None else f"at look {spec.look} of {len(spec.looks)}"
    rows: list[tuple] = [
        ("Conditions", ", ".join(found.conditions)),
        ("Control", found.control),
        ("Participants recorded", str(people)),
        ("Participants compared", str(len(found.participants))),
        ("Movements in use", f"{found.movements:,}"),
        ("Analysed", f"{look}, level {100.0 * spec.alpha:.3g} % of each one-sided test"),
        ("End of a movement", f"last sample above {100.0 * spec.threshold:g} % of its largest speed"),
        ("Low-pass of the angle", f"{spec.lowpass:g} Hz, order {spec.order}, zero phase"),
        ("Loss that is allowed", f"{100.0 * spec.max_left_out:g} % of a condition's movements and of participants"),
    ]
    order = [
        (entry.participant, entry.condition, entry.period)
        for entry in study.config.recordings
        if entry.condition is not None and entry.period is not None
    ]
    shown = [_table(("What", "How"), rows, "Protocol, as study.toml states it.", 2)]
    if order:
        people_order = dict.fromkeys(person for person, *_ in order)
        listed = [
            (person, " → ".join(c for _, c in sorted({(p, c) for who, c, p in order if who == person})))
            for person in people_order
        ]
        shown.append(_table(("Participant", "Order"), listed, "Order of conditions.", 2))
    return Section("protocol", "Protocol", tables=tuple(shown))


def _margins(spec: AssessmentTable, found: AssessmentResult) -> Section:
    points = found.certified[0].end_points
    rows = [
        (point.index.words, point.stated, spec.justification.get(name, "none stated")) for name, point in points.items()
    ]
    lacking = [point.index.words.lower() for name, point in points.items() if name not in spec.justification]
    note = (
        f"No justification is stated for {', '.join(lacking)}: say in [assessment.justification] why such a change "
        "does not matter.",
    )
    return Section(
        "margins",
        "Margins and estimand",
        (
            f"The estimand is the {TEST_NAMES[found.certified[0].test]}, stated in study.toml. All end points must lie "
            "within their margins.",
        ),
        (_table(("Index", "Margin", "Why a change of this size does not matter"), rows, "Margins.", 3),),
        notes=note if lacking else (),
    )


def _assumptions(found: AssessmentResult) -> Section:
    each = found.certified[0]
    texts = [
        f"The level of each test holds if {TEST_ASSUMPTIONS[each.test]}.",
        "No test sees people who are not in the sample. A group of "
        f"{100.0 * HIDDEN_SHARE:g} % of people is missing from "
        f"{100.0 * (1.0 - HIDDEN_SHARE) ** each.participants:.2g} % of studies of {each.participants} people; "
        f"with fewer than {MIN_PEOPLE} nothing is claimed of a mean.",
        f"Nothing is claimed to lie within where a person's change exceeds {FAR_MARGIN_COUNT:g} margins.",
        "Participants are independent of each other and drawn from those of whom the claim is made.",
    ]
    texts += [text for own in found.certified for text in own.unknown]
    rows = [
        (own.condition, point.index.short, people_text(own.certificate.end_points[name]))
        for own in found.certified
        for name, point in own.end_points.items()
    ]
    share = _table(("Condition", "Index", "People within"), rows, "Share of people within, a lower bound.", 2)
    return Section("assumptions", "Assumptions", tuple(dict.fromkeys(map(typeset_sentence, texts))), (share,))


def _sensitivity(found: AssessmentResult) -> Section:
    beside = tables.beside_table(found)
    shown = [_table(beside.heads, list(beside.rows), f"{beside.title.rstrip('.')}.", 3)] if beside.rows else []
    for own in (tables.doubt_table(found), tables.range_table(found)):
        if own.rows:
            shown.append(_table(own.heads, list(own.rows), f"{own.title.rstrip('.')}.", 2))
    text = (
        "No verdict rests on a sensitivity analysis. What else could have changed an end point can take a claim away, "
        "and never makes one."
    )
    return Section("sensitivity", "Sensitivity", (text,), tuple(shown))


def _exclusions(found: AssessmentResult) -> Section:
    rows: list[tuple] = [("participant", person, why) for person, why in found.without.items()]
    rows += [("recording", name, why) for name, why in found.unusable.items()]
    rows += [
        ("movements", str(count), REASON_WORDS.get(why, "that went as far as another label"))
        for why, count in found.left_out.items()
    ]
    for each in found.certified:
        for name, by in each.lost.items():
            for condition, (gone, of) in by.items():
                if gone:
                    words = each.end_points[name].index.short if name in each.end_points else name
                    rows.append((f"{words}, {condition}", f"{gone} of {of}", "movements without a value"))
    if not rows:
        return Section("exclusions", "Exclusions", ("Nobody and nothing was left out.",))
    return Section(
        "exclusions", "Exclusions", tables=(_table(("What", "Which", "Why"), rows, "All that was left out.", 3),)
    )


def _checksums(study: Study, found: AssessmentResult) -> Table:
    rows = [("study.toml", checksum(study.folder / "study.toml")), *found.checksums.items()]
    return _table(("File or recording", "SHA-256"), rows, "Checksums of all that was read.", 2)
