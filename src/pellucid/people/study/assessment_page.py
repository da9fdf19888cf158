"""Report of an assessment, and page for the reviewer of a certificate.

The report has findings, missing evidence and every participant. The reviewer's page has the
statements made before the data, the results, and the exclusions.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ..._printed_command import printed_command
from ...study.drawing.drawing import Drawing, draw
from ...study.pages.forest import Row, Table
from ...study.pages.page import Page, Section, Tile, without_drawing, write_page
from ...study.pages.quantities import name_words, number, typeset_cell, typeset_sentence, unit_text
from ...study.pages.values import Value
from ...study.procedures.procedure import quiet
from ...study.procedures.result import FigureTable
from ...study.procedures.study_page import provenance, study_page
from ...study.study import Study, checksum
from ..analysis import ANALYSIS_FILE
from ..certificate import FAIL, Certificate
from ..certificate_text import lowered, p_statement, people_text
from ..indices import SHOWN_INDICES, index_names, leading_index
from ..share_of_people import HIDDEN_SHARE, MIN_PEOPLE, MODEL_PEOPLE
from . import assessment_figures as figures
from . import assessment_tables as tables
from .assessment_answer import change_value, known_changes, reviewed_answer
from .assessment_result import AssessmentResult, kept_certificates
from .assessment_table import AssessmentTable
from .certified_rows import TEST_ASSUMPTIONS, TEST_NAMES, certificate_remarks, certificate_sentences
from .pointing import reason_words
from .primary_change import ESTIMAND_WORDS, primary_change


def page(study: Study, findings: AssessmentResult) -> Page:
    """Build the page of an assessment."""
    sections = [
        *((_certificate(findings),) if findings.certified else ()),
        _found(findings),
        _people(findings),
        _movements(findings),
    ]
    if findings.isochrony:
        sections.append(_isochrony(findings))
    sections += [_sensitivity(findings)]
    if findings.needed:
        sections.append(_needed(findings))
    sections.append(_method(study, findings))
    return Page(
        title=f"{findings.study}: assessment",
        kicker="Pellucid report",
        tiles=_tiles(findings),
        sections=without_drawing(sections, "certificate"),
        footer=f"Written by pellucid {version('pellucid')}. Every figure is a file in this page's folder; every number "
        "is in results.json.",
        verdicts=_verdicts(findings),
        answer=findings.answer,
        figure=_figure(findings),
    )


def _verdicts(findings: AssessmentResult) -> tuple[tuple[str, str], ...]:
    """Return the verdicts, without those of the certificate, which the answer and its section tell."""
    told = set(certificate_sentences(findings)) if findings.certified else set()
    return tuple((v.kind, typeset_sentence(v.said)) for v in findings.verdicts if v.text not in told)


def _figure(findings: AssessmentResult) -> Drawing:
    """Return the figure that shows the answer: the certificate, or the changes of the leading index."""
    if findings.certified:
        return draw(figures.certificate_figure, findings.certified)
    each = findings.assessed.get(leading_index().name) or next(iter(findings.assessed.values()))
    turning = findings.profiles if findings.along.unit == "rad" else ()
    return draw(
        figures.changes_figure, each, known_changes(findings, each.name), findings.control, findings.study, turning,
        findings.profile_of,
    )  # fmt: skip


def _tiles(findings: AssessmentResult) -> tuple[Tile, ...]:
    made = []
    for index in SHOWN_INDICES:
        each = findings.assessed.get(index.name)
        if each is None or index.tile is None:
            continue
        others = [c for c in each.table.conditions if c != findings.control]
        if not others:
            continue
        changes = {c: primary_change(findings, index.name, c) for c in others}
        known = {c: change for c, change in changes.items() if change is not None}
        if known:
            shown = {c: x.value for c, x in known.items()}
            texts = {c: str(change_value(findings, index.name, c, x)) for c, x in known.items()}
            unit = f"{unit_text(next(iter(known.values())).unit)} against {findings.control}".strip()
        else:
            shown = {c: float(each.table.column(c).mean()) for c in others}
            rows = {c: f"{findings.study}.transparency.{index.name}.{c.lower()}" for c in shown}
            texts = {c: str(Value(rows[c], x, number(x, digits=3))) for c, x in shown.items()}
            unit = f"{unit_text(each.table.index.unit)}{index.tile.after_unit}"
        least = min(shown, key=lambda c: abs(shown[c]) if np.isfinite(shown[c]) else np.inf)
        rest = ", ".join(f"{name_words(c)} {text}" for c, text in texts.items() if c != least)
        made.append(Tile(f"{index.tile.label}, {name_words(least)}", texts[least], unit, rest))
    return tuple(made)


def _certificate(findings: AssessmentResult) -> Section:
    drawings = [draw(figures.certificate_figure, findings.certified)]
    if any(each.curves for each in findings.certified):
        drawings.append(draw(figures.curves_figure, findings.certified, findings.conditions))
    return Section(
        "assess_certificate",
        "Certificate",
        tuple(map(typeset_sentence, certificate_sentences(findings))),
        tuple(_table(each) for each in tables.certificate_tables(findings)),
        tuple(drawings),
        (
            "Each end point has two one-sided tests. The claim requires all end points to lie within, so no level is "
            "divided by their number. Holm's correction applies to claims of a change beyond the margin. The test of "
            "the mean uses Student's statistic with its least favourable skewed distribution; the test of the "
            "pseudo-median uses exact signed ranks. The share of people within is a distribution-free lower confidence "
            "bound. The mixed model describes movements, with a level and a change for each participant. An end point "
            "is undecided if its result changes once another possible cause is removed.",
            *map(typeset_sentence, certificate_remarks(findings)),
        ),
    )


def _found(findings: AssessmentResult) -> Section:
    shown = [tables.summary_table(findings), tables.test_table(findings)]
    if any(each.comparison.nemenyi is not None for each in findings.assessed.values()):
        shown.append(tables.pair_table(findings))
    shown.append(tables.effect_table(findings))
    return Section(
        "assess_found",
        "Results",
        tuple(map(typeset_sentence, findings.paragraph.split("\n\n"))),
        tuple(_table(each) for each in shown if each.rows),
    )


def _people(findings: AssessmentResult) -> Section:
    panels = index_names(lambda index: index.panel_place)
    drawn = {name: findings.assessed[name] for name in panels if name in findings.assessed}
    described = tuple(_table(tables.description_table(findings, each)) for each in findings.assessed.values())
    drawing = draw(figures.index_figure, drawn, findings.conditions)
    return Section("assess_people", "Every participant", tables=described, drawings=(drawing,))


def _movements(findings: AssessmentResult) -> Section:
    settling = draw(figures.settling_figure, findings.settling, findings.conditions)
    drawing = draw(figures.profile_figure, findings.profiles, findings.profile_of, findings.conditions, findings.along)
    table = _table(tables.settling_table(findings))
    return Section("assess_movements", "Movements", tables=(table,), drawings=(settling, drawing))


def _isochrony(findings: AssessmentResult) -> Section:
    drawing = draw(figures.isochrony_figure, findings.isochrony, findings.conditions)
    table = _table(tables.isochrony_table(findings))
    return Section("assess_isochrony", "Isochrony", tables=(table,), drawings=(drawing,))


def _sensitivity(findings: AssessmentResult) -> Section:
    text = (
        "The published indices with other settings: other cut-offs of the angle's filter, other speed thresholds for "
        "onset and end, and movements that end at the first instead of the last fall of the speed below the threshold. "
        "A column in ms states the assumed delay of the markers in recordings without an encoder."
    )
    table = tables.sensitivity_table(findings)
    shown = (_table(table),) if table.rows else ()
    return Section("assess_filters", "Other filters", (text,), shown)


def _needed(findings: AssessmentResult) -> Section:
    text = (
        f"Number of participants for a power of 80 %: signed-rank tests against {findings.control}, with Holm's "
        f"correction for the smallest p value. Changes from {findings.control} are sampled from a normal distribution "
        "with this study's standard deviation in the condition with the largest variation, which is itself uncertain "
        "with few participants."
    )
    if findings.needed_as_seen:
        seen = ", ".join(f"{name} {tables.people_words(n)}" for name, n in findings.needed_as_seen.items())
        text += (
            f" If the changes of {lowered(leading_index().words)} are as seen here, and people vary together over "
            f"conditions as here, Friedman's and Nemenyi's tests together need: {seen}."
        )
    shown = tables.needed_table(findings), tables.effect_size_table(findings)
    return Section("assess_needed", "Participants needed", (text,), tuple(_table(each) for each in shown if each.rows))


def _method(study: Study, findings: AssessmentResult) -> Section:
    spec = study.table(AssessmentTable)
    paragraphs = [
        f"The angle passes a zero-phase Butterworth low-pass of order {spec.order} at {spec.lowpass:g} Hz. A movement "
        f"lasts from the first to the last sample above {100 * spec.threshold:g} % of its largest speed. A "
        "participant's value is the mean over movements that are alike, then over amplitudes and directions."
    ]
    paragraphs.append(
        "A movement that was not at rest when the next target came has not settled, so that its duration is longer "
        "than observed. The median duration accounts for this (Kaplan-Meier); the mean uses the observed part."
    )
    paragraphs.append(
        "The end-point error is that of the movement's last sample, along its direction; the participant's movements "
        f"in {findings.control}, averaged over both directions, define the angle of the target's 0. The variable error "
        "is the standard deviation of the end points of equal movements."
    )
    if spec.agonists:
        paragraphs.append(
            "EMG is band-passed from 20 to 450 Hz (order 4), centred, rectified, divided by the muscle's largest value "
            f"in all of the participant's recordings, and taken {spec.advance:g} s earlier than the motion. EMG/Acc is "
            "the mean RMS of the agonists over the largest acceleration of upward movements, relative to the same "
            f"participant and amplitude in {findings.control}, less 1."
        )
    paragraphs.append(
        "Friedman's test has an exact p-value; Nemenyi's test uses the studentised range. Signed-rank tests against "
        f"{findings.control} have exact p-values with Holm's correction. Changes from {findings.control} are the "
        f"{ESTIMAND_WORDS[findings.estimand]}, of ratios where a percentage is reported, with the interval of the "
        "certificate's test. Sensitivity analyses are the mixed model and differences of means, whose bootstrap "
        "intervals over participants are widened for small samples."
    )
    return Section("assess_method", "How", (" ".join(paragraphs),), notes=study.notes)


def _table(table: FigureTable) -> Table:
    rows = tuple(Row(tuple(typeset_cell(cell) for cell in row)) for row in table.rows)
    words = 2 if len(table.heads) > 1 and table.heads[1] in ("", "Rule", "Change") and table.heads[0] != "" else 1
    words = 2 if table.heads[:2] == ("", "") or table.heads[0] == "Condition" else words
    words = 3 if table.heads[2:3] == ("Analysis",) else words
    return Table(table.heads, rows, numeric=frozenset(range(words, len(table.heads))), caption=table.title, wide=True)


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
    return write_certificate_of(study, kept_certificates(study, "margins to certify", on_progress or quiet))


def write_certificate_of(study: Study, found: AssessmentResult) -> Path:
    """Write the page for a reviewer of what `kept_certificates` returned, and return its path."""
    return write_page(Path(study.place(PAGE_FOLDER)), reviewer_page(study, study.table(AssessmentTable), found))


def reviewer_page(study: Study, spec: AssessmentTable, found: AssessmentResult) -> Page:
    """Build the page: verdicts, protocol, margins, assumptions, results, sensitivity, exclusions, provenance."""
    verdicts = [(each.condition, each.certificate.statement) for each in found.certified]
    command = printed_command("certificate", study.folder)
    return study_page(
        f"{found.study}: certificate",
        reviewed_answer(found),
        [Tile(name_words(condition), verdict, "", _p_of_verdict(each.certificate))
         for each, (condition, verdict) in zip(found.certified, verdicts, strict=True)],
        [_result(found), _protocol(study, spec, found), _margins(spec, found), _assumptions(found),
         _other_analyses(found), _exclusions(spec, found),
         provenance(study, [("Made again by", command)], _checksums(study, found))],
        figure=_figure(found),
    )  # fmt: skip


def _plain_table(heads: tuple[str, ...], rows: list[tuple], caption: str, words: int = 1) -> Table:
    made = tuple(Row(tuple(typeset_cell(cell) for cell in row)) for row in rows)
    # A table of words alone is as narrow as the screen, where one that fills the page would go on behind its edge.
    return Table(heads, made, frozenset(range(words, len(heads))), caption, words < len(heads))


def _p_of_verdict(own: Certificate) -> str:
    """Return the p value of the claim that was tested: beyond its margin of one end point, or else within of all."""
    if own.verdict == FAIL:
        p, claim = min([*own.beyond.values(), *own.far.values()]), "test that an end point is beyond its margin"
    else:
        p, claim = own.p_value, "test that all end points are within their margins"
    return f"{claim}: {p_statement(p)} (shown at {own.alpha:g} or less)"


def _result(found: AssessmentResult) -> Section:
    own = tables.certificate_tables(found)[0]
    return Section(
        "verdict",
        "Verdict",
        tuple(map(typeset_sentence, certificate_sentences(found))),
        tables=(_plain_table(own.heads, list(own.rows), f"{own.title.rstrip('.')}.", 2),),
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
        ("Registered", _registration(found)),
        ("Design", spec.design or "not stated"),
        ("Washout", spec.washout or "not stated"),
        ("Analysed", f"{look}, level {100.0 * spec.analysis.alpha:.3g} % of each one-sided test"),
        ("End of a movement", f"last sample above {100.0 * spec.threshold:g} % of its largest speed"),
        ("Low-pass of the angle", f"{spec.lowpass:g} Hz, order {spec.order}, zero phase"),
        ("Loss that is allowed", f"{100.0 * spec.max_left_out:g} % of a condition's movements and of participants"),
    ]
    order = [
        (entry.participant, entry.condition, entry.period)
        for entry in study.config.recordings
        if entry.condition is not None and entry.period is not None
    ]
    shown = [_plain_table(("What", "How"), rows, "Protocol, as study.toml states it.", 2)]
    if order:
        people_order = dict.fromkeys(person for person, *_ in order)
        listed = [
            (person, " → ".join(c for _, c in sorted({(p, c) for who, c, p in order if who == person})))
            for person in people_order
        ]
        shown.append(_plain_table(("Participant", "Order"), listed, "Order of conditions.", 2))
    return Section("protocol", "Protocol", tables=tuple(shown))


def _registration(found: AssessmentResult) -> str:
    """Say whether the analysis is the registered one."""
    if not found.is_registered:
        return f"no {ANALYSIS_FILE} was registered"
    apart = found.certified[0].certificate.post_hoc
    return f"post hoc, {ANALYSIS_FILE} differs: {'; '.join(apart)}" if apart else f"as in {ANALYSIS_FILE}"


def _margins(spec: AssessmentTable, found: AssessmentResult) -> Section:
    points = found.certified[0].end_points
    rows = [
        (point.index.words, point.stated, spec.justification.get(name, "none stated")) for name, point in points.items()
    ]
    lacking = [point.index.words.lower() for name, point in points.items() if name not in spec.justification]
    note = (
        f"No justification is stated for {', '.join(lacking)}: state in [assessment.justification] why a change of "
        "this size does not matter.",
    )
    return Section(
        "margins",
        "Margins and estimand",
        (
            f"The estimand is the {TEST_NAMES[found.certified[0].test]}, stated in study.toml. All end points must lie "
            "within their margins.",
        ),
        (_plain_table(("Index", "Margin", "Why a change of this size does not matter"), rows, "Margins.", 3),),
        notes=note if lacking else (),
    )


def _assumptions(found: AssessmentResult) -> Section:
    each = found.certified[0]
    rule = each.certificate.rule
    texts = [
        f"The level of each test holds if {TEST_ASSUMPTIONS[each.test]}.",
        "No test detects an effect on people who are not in the sample. A group of "
        f"{100.0 * HIDDEN_SHARE:g} % of people is absent from "
        f"{100.0 * (1.0 - HIDDEN_SHARE) ** each.participants:.2g} % of studies of {each.participants} people; "
        f"with fewer than {MIN_PEOPLE} no end point is claimed to lie within.",
        f"For each end point the study must show that at least {100.0 * rule.within:g} % of people lie within the "
        f"margin, and at most {100.0 * rule.far:g} % beyond {rule.far_margins:g} margins. Each test has a level of "
        f"{100.0 * rule.alpha:g} %. With fewer than {MODEL_PEOPLE} people these bounds assume normal changes, unless "
        "the changes look otherwise.",
        "Participants are independent of each other and sampled from the population of the claim.",
    ]
    texts += [text for own in found.certified for text in own.unknown]
    rows = [
        (own.condition, point.index.short, people_text(own.certificate.end_points[name].share_test(rule)))
        for own in found.certified
        for name, point in own.end_points.items()
    ]
    legend = "Shares of people within the margin and far beyond it, with their bounds."
    share = _plain_table(("Condition", "Index", "People"), rows, legend, 2)
    return Section("assumptions", "Assumptions", tuple(dict.fromkeys(map(typeset_sentence, texts))), (share,))


def _other_analyses(found: AssessmentResult) -> Section:
    beside = tables.beside_table(found)
    shown = [_plain_table(beside.heads, list(beside.rows), f"{beside.title.rstrip('.')}.", 3)] if beside.rows else []
    for own in (tables.doubt_table(found), tables.range_table(found)):
        if own.rows:
            shown.append(_plain_table(own.heads, list(own.rows), f"{own.title.rstrip('.')}.", 2))
    text = (
        "Sensitivity analyses do not change a verdict. Another possible cause of a change can withdraw a claim but "
        "never adds one."
    )
    return Section("sensitivity", "Sensitivity", (text,), tuple(shown))


def _exclusions(spec: AssessmentTable, found: AssessmentResult) -> Section:
    rows: list[tuple] = [("rule", rule, "rule of study.toml") for rule in spec.exclusions]
    rows += [("participant", person, why) for person, why in found.without.items()]
    rows += [("recording", name, why) for name, why in found.unusable.items()]
    rows += [
        ("movements", str(count), reason_words(why))
        for why, count in found.left_out.items()
    ]
    for each in found.certified:
        for name, by in each.lost.items():
            for condition, (gone, of) in by.items():
                if gone:
                    words = each.end_points[name].index.short if name in each.end_points else name
                    rows.append((f"{words}, {condition}", f"{gone} of {of}", "movements without a value"))
    if not rows:
        return Section("exclusions", "Exclusions", ("There were no exclusions.",))
    return Section(
        "exclusions", "Exclusions", tables=(_plain_table(("What", "Which", "Why"), rows, "All exclusions.", 3),)
    )


def _checksums(study: Study, found: AssessmentResult) -> Table:
    rows = [("study.toml", checksum(study.folder / "study.toml")), *found.checksums.items()]
    return _plain_table(("File or recording", "SHA-256"), rows, "Checksums of all that was read.", 2)
