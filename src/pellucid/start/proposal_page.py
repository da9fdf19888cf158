"""The page of a proposal: every channel with its role, the questions, and the columns that are not used.

Figures of a proposal: every column with its proposed role, and the spectrum that the processing comes from.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..study.answer import Answer, AnswerVerdict, Basis, Step, with_assumed
from ..study.drawing.drawing import Drawing, Head, draw, heads, key, line, one_panel, tidy
from ..study.drawing.style import FIGURE_WIDTH, colour
from ..study.pages.forest import Row, Table, number_table
from ..study.pages.page import Page, Section, Tile, without_drawing
from .given_files import GivenFiles, GivenTable
from .inference.assign_roles import ColumnRole
from .inference.processing_choice import PROCESSING_LIMITS, ProcessingChoice
from .proposal import Layout, Proposal
from .study_text import channel_mark, channel_name, defaults_of

QUESTIONS = {
    "init": "Can a study be made of these files?",
    "try": "Can a model be identified from these files?",
}
"""Questions of the commands that read files, by command."""

ADVICE_VERBS = ("Correct", "Export", "Record", "Rename", "State", "Remove", "Pass", "Use", "Write", "Name")
"""Verbs with which a message begins to say what to do."""

MAX_FIRST_PANELS = 4
"""The first figure has at most so many panels, so that its letters are legible on the first screen."""

MAX_PANELS_IN_FIGURE = 12
"""A figure has at most so many panels; further columns get a figure of their own."""

MAX_PANELS = 60
"""At most so many columns of a layout are drawn."""

MAX_CONFIRMING_STEPS = 3
"""Largest number of open questions that the next steps name; a section of the page lists all."""

WITH_ASSUMPTIONS = "with assumptions"
"""Limit of the answer yes where defaults and guesses were taken."""

MAX_DRAWN_ROWS = 100_000
"""At most so many rows of a column are drawn, evenly spread."""


def channel_figures(layout: Layout, table: GivenTable, name: str, marks: dict[str, str]) -> list[Drawing]:
    """Plot every column of a table with its role, used ones first; `marks` says by column which roles are guesses."""
    roles = [role for role in layout.roles.roles if role.column in table.columns][:MAX_PANELS]
    roles.sort(key=lambda role: role.quantity is None)
    starts = [0, *range(MAX_FIRST_PANELS, len(roles), MAX_PANELS_IN_FIGURE)]
    parts = [roles[start:stop] for start, stop in pairwise((*starts, len(roles)))]
    return [
        draw(_panels, layout, table, part, name=f"{name}_{i}", marks=marks) for i, part in enumerate(parts, start=1)
    ]


def _panels(
    layout: Layout, table: GivenTable, roles: Sequence[ColumnRole], *, name: str, marks: dict[str, str]
) -> Drawing:
    rows = (len(roles) + 1) // 2
    figure = Figure(figsize=(FIGURE_WIDTH, 1.0 + 1.35 * rows), layout="constrained")
    grid = figure.subplots(rows, 2, squeeze=False, sharex=True)
    time, label = _times(layout, table)
    stride = max(1, len(time) // MAX_DRAWN_ROWS)
    for k in range(rows):
        texts = []
        pair = [axis for axis, i in zip(grid[k], (2 * k, 2 * k + 1), strict=True) if i < len(roles)]
        for axis, role in zip(pair, roles[2 * k : 2 * k + 2], strict=True):
            mark = marks.get(role.column, "")
            tone = colour("muted" if role.quantity is None else "heldout" if mark else "fitted")
            line(axis, time[::stride], table.columns[role.column][::stride], color=tone, linewidth=1.0)
            tidy(axis, first=True, ticks=3)
            texts.append(Head(_short(role.column, 30), _role_text(role, mark), tone))
        heads(pair, texts)
    for axis in grid[-1]:
        axis.set_xlabel(label)
    if len(roles) % 2:
        grid[-1][1].set_visible(False)
    return Drawing(
        name,
        figure,
        f"Columns of {table.path.name} as stored in the file, with their proposed roles. Blue: decided by evidence. "
        "Orange: a guess, or depends on a question. Grey: not used.",
    )


def spectrum_figure(choice: ProcessingChoice, rate: float, name: str) -> Drawing:
    """Draw the power of the position's second derivative, with the proposed low-pass."""
    figure, axis = one_panel(3.0)
    axis.loglog(
        choice.frequency, np.maximum(choice.acceleration_power, 1e-300), color=colour("measured"), linewidth=1.0
    )
    axis.loglog(choice.frequency, choice.smoothed_power, color=colour("heldout"), linewidth=1.2)
    margin = PROCESSING_LIMITS.floor_margin
    axis.axhline(margin * choice.smoothed_power[choice.floor], color=colour("muted"), linewidth=0.9)
    axis.axvline(choice.lowpass, color=colour("fitted"), linewidth=1.4)
    axis.axvline(0.5 * rate / choice.decimate, color=colour("muted"), linewidth=0.9, linestyle=(0, (4, 3)))
    axis.set_xlabel("Frequency (Hz)")
    axis.set_ylabel("Power of the acceleration")
    key(
        axis,
        [
            ("smoothed", colour("heldout")),
            (f"low-pass {choice.lowpass:g} Hz", colour("fitted")),
            (f"{margin:g} times the noise floor; half the rate after decimation", colour("muted")),
        ],
    )
    return Drawing(
        name,
        figure,
        "Spectrum of the acceleration computed from the position, and the same smoothed. It falls where the motion "
        "ends, and rises where quantization and noise of the twice differentiated position dominate. Its noise floor "
        f"is the minimum of the smoothed spectrum, at {choice.frequency[choice.floor]:.3g} Hz. From {choice.cut:.3g} "
        f"Hz on to there it is at most {margin:g} times that (horizontal line). Low-pass: {choice.why}.",
    )


def _times(layout: Layout, table: GivenTable) -> tuple[np.ndarray, str]:
    clock, rate = layout.roles.clock, layout.roles.rate
    if clock.column is not None and clock.column in table.columns:
        times = clock.seconds(table.columns[clock.column])
        return times - np.nanmin(times), "Time (s)"
    rows = np.arange(table.rows)
    return (rows / rate, "Time (s)") if rate else (rows, "Row")


def _role_text(role: ColumnRole, mark: str) -> str:
    if role.quantity is None:
        return "not used"
    return _short(f"{channel_name(role)} [{role.unit}]" + (f"  {mark}" if mark else ""), 44)


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def proposal_page(proposal: Proposal, folder: Path) -> Page:
    """Return the page of a proposal from which the study in `folder` was made."""
    page = _with_answer(
        _page(proposal, "study.toml has a comment for each of these lines."),
        QUESTIONS["init"],
        "yes",
        (
            Step("Read each comment in study.toml that marks a guess, then check the study", "check", (), str(folder)),
            *(
                Step(f"Confirm `{q.key}`, which is {q.default} by default: {q.text}")
                for q in proposal.open_questions[:MAX_CONFIRMING_STEPS]
            ),
        ),
        _basis_of(proposal),
    )
    answer = with_assumed(replace(page.answer, is_relative=True), defaults_of(proposal))
    assumed = WITH_ASSUMPTIONS if answer.assumed or _guess_count(proposal) else ""
    return replace(page, answer=replace(answer, qualifier=answer.qualifier or assumed))


def unmade_page(proposal: Proposal, reason: str, again: str) -> Page:
    """Return the page of a proposal of which no study can be made, for a `reason`; `again` is the command to repeat."""
    page = _page(proposal, "No study was written.")
    command, following = again.split()[1], steps_after_refusal(reason, again)
    page = replace(page, title=proposal.name, kicker=f"Pellucid {command}", headline=_sentence(reason))
    return _with_answer(page, QUESTIONS[command], "no", following, _basis_of(proposal))


def steps_after_refusal(reason: str, again: str) -> tuple[Step, ...]:
    """Return what to do after a refusal: what its message says, and the command to repeat.

    A message says what was found and what is expected, and may end with what to do, or with an answer to give.
    """
    told = re.search(r'--answer (?:"(?P<quoted>[^"]+)"|(?P<plain>[^\s,.;]+=\S+))', reason)
    given = "" if told is None else (told["quoted"] or told["plain"])
    do = re.search(rf"(?<=[.;] )(?:{'|'.join(ADVICE_VERBS)}) .*", _with_capitals(reason))
    expected = re.search(r"expected (.*)", reason)
    if given:
        return (Step("Repeat the command with the correct value", line=f"{again} --answer {shlex.quote(given)}"),)
    if do is not None:
        first = do[0]
    else:
        first = f"Correct the files, or record again: expected {expected[1]}" if expected else "Correct the files"
    return Step(first), Step("Then repeat", line=again)


def _with_capitals(text: str) -> str:
    """Return a text in which what follows a semicolon begins like a sentence."""
    return re.sub(r"(?<=; )[a-z]", lambda found: found[0].upper(), text)


def files_page(given: GivenFiles, name: str, reason: str, again: str) -> Page:
    """Return the page of files for which nothing can be proposed, for a `reason`; `again` is the command to repeat."""
    command, count = again.split()[1], len({table.path for table in given.tables})
    rows = tuple(
        Row((table.path.name, column, table.units.get(column, ""), str(len(values))))
        for table in given.tables
        for column, values in table.columns.items()
    )
    unread = tuple(Row((path.name, why)) for path, why in given.unread)
    sections = [
        Section("columns", "Columns", tables=(number_table(("File", "Column", "Unit", "Rows"), rows, words=3),))
    ]
    if unread:
        sections.append(Section("unread", "Files that were not read", tables=(Table(("File", "Reason"), unread),)))
    return Page(
        name,
        f"Pellucid {command}",
        "",
        (),
        tuple(sections),
        f"Written by pellucid {version('pellucid')}. No study was written.",
        answer=Answer(
            QUESTIONS[command], "no", _sentence(reason), reason, next=steps_after_refusal(reason, again),
            basis=Basis(count, count + len(given.unread), "file"),
        ),
    )  # fmt: skip


def _basis_of(proposal: Proposal) -> Basis:
    """Return what a proposal is based on: its recordings, of which one may be split."""
    count, parts = proposal.whole_count, len(proposal.recordings)
    return Basis(count, count, is_simulated=proposal.is_simulated or None, parts=parts if parts > count else 0)


def _page(proposal: Proposal, footer: str) -> Page:
    """Return the page of a proposal without its answer."""
    guesses = _guess_count(proposal)
    count = sum(len(layout.channels) for layout in proposal.layouts)
    rate = proposal.rate
    sections = (
        *_question_sections(proposal),
        *(_layout_section(layout, proposal) for layout in proposal.layouts),
        *_last(proposal),
    )
    return Page(
        f"Proposal: {proposal.name}",
        "Pellucid init",
        _headline(proposal, count, guesses),
        (
            Tile("recordings", str(proposal.whole_count)),
            Tile("channels", str(count), more=f"{guesses} to confirm"),
            Tile("sampling rate", f"{rate:.4g}" if rate else "unknown", "Hz" if rate else ""),
            Tile("questions", str(len(proposal.asked)), more="each has a default" if proposal.asked else ""),
        ),
        sections,
        f"Written by pellucid {version('pellucid')}. {footer}",
    )


def _guess_count(proposal: Proposal) -> int:
    return sum(bool(channel_mark(role, proposal)) for layout in proposal.layouts for role in layout.channels)


def _with_answer(
    page: Page, question: str, verdict: AnswerVerdict, following: tuple[Step, ...], basis: Basis
) -> Page:
    """Return a page whose headline answers a question, with the first figure moved from its section to the top."""
    figure = next((drawing for section in page.sections for drawing in section.drawings), None)
    sections = page.sections if figure is None else without_drawing(page.sections, figure.name)
    reason = "" if verdict == "yes" else page.headline
    answer = Answer(question, verdict, page.headline, reason, basis=basis, next=following)
    return replace(page, sections=sections, answer=answer, figure=figure)


def _headline(proposal: Proposal, count: int, guesses: int) -> str:
    joints, decided = len(proposal.main.roles.joints), count - guesses
    what = f"a joint with a {proposal.drive} drive" if proposal.drive else "motion"
    what = "a person's joints" if proposal.is_person else f"{joints} joints" if joints > 1 else what
    said = f"{decided} identified from the data, {guesses} to be confirmed"
    open_ones = len(proposal.open_questions)
    questions = "1 question" if open_ones == 1 else f"{open_ones} questions"
    asked = f" {questions} open; a default is assumed for each." if open_ones else ""
    return f"The files contain {what}: {count} channels, {said}.{asked}"


def _question_sections(proposal: Proposal) -> list[Section]:
    if not proposal.asked:
        return []
    rows = tuple(
        Row((q.text, proposal.answers.get(q.key, f"{q.default} (default)"), q.consequence)) for q in proposal.asked
    )
    table = Table(("Question", "Answer", "The answer decides"), rows, wide=True)
    marked = tuple(f"Marked, not asked: {q.text} Taken: {q.default}." for q in proposal.marked)
    return [Section("questions", "Questions that the files cannot answer", tables=(table,), notes=marked)]


def _layout_section(layout: Layout, proposal: Proposal) -> Section:
    name = layout.stream or "recording"
    marks = {role.column: channel_mark(role, proposal) for role in layout.channels}
    clock, table = layout_tables(layout, proposal)
    drawings = channel_figures(layout, layout.tables[0], f"channels_{layout.stream or 'main'}", marks)
    return Section(
        f"channels-{name}",
        "Channels" if not layout.stream else f"Channels of the stream {layout.stream}",
        (clock,),
        (table,),
        tuple(drawings),
    )


def layout_tables(layout: Layout, proposal: Proposal) -> tuple[str, Table]:
    """Return the clock of a layout in a sentence, and the table of its columns with their roles."""
    rows = []
    for role in layout.roles.roles:
        channel = channel_name(role) if role.quantity is not None else "not used"
        why = "; ".join(dict.fromkeys(text for text in (role.why, role.unit_why) if text))
        mark = channel_mark(role, proposal) if role.quantity is not None else ""
        rows.append(Row((role.column, channel, role.unit if role.quantity else "", mark, why), bool(mark)))
    clock = layout.roles.clock
    said = f'Time is the column "{clock.column}" in {clock.unit}' if clock.column else "Time"
    return f"{said}: {clock.why}.", Table(("Column", "Channel", "Unit", "Mark", "Why"), tuple(rows), wide=True)


def _last(proposal: Proposal) -> list[Section]:
    sections = []
    if proposal.processing is not None and proposal.rate is not None:
        sections.append(
            Section(
                "processing",
                "Processing",
                (f"Proposed low-pass: {proposal.processing.lowpass:g} Hz. {_sentence(proposal.processing.why)}",),
                drawings=(draw(spectrum_figure, proposal.processing, proposal.rate, "spectrum"),),
            )
        )
    rows = tuple(
        Row((r.name, r.table.path.name, r.use, r.participant or "", r.condition or "", r.why))
        for r in proposal.recordings
    )
    table = Table(("Recording", "File", "Use", "Participant", "Condition", "Why"), rows, wide=True)
    sections.append(Section("recordings", "Recordings", tables=(table,)))
    if proposal.remarks:
        sections.append(Section("remarks", "Remarks", tuple(_sentence(text) for text in proposal.remarks)))
    return sections


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}" + ("" if text.endswith(".") else ".")
