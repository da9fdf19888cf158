"""The page of a proposal: what was read, every channel beside its role, what is asked, and what is left out."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from .._printed_command import printed_command
from ..study.drawing.drawing import draw
from ..study.pages.page import Answer, Page, Section, Tile, without_drawing
from ..study.pages.tables import Row, Table
from .proposal_figures import channel_figures, spectrum_figure
from .propose_study import Layout, Proposal
from .study_text import channel_mark, channel_name


def proposal_page(proposal: Proposal, folder: Path) -> Page:
    """Return the page of a proposal."""
    layouts = [proposal.main, *proposal.streams]
    guesses = sum(bool(channel_mark(role, proposal)) for layout in layouts for role in layout.channels)
    count = sum(len(layout.channels) for layout in layouts)
    rate = proposal.rate
    sections = (
        *_question_sections(proposal), *(_layout_section(layout, proposal) for layout in layouts), *_last(proposal),
    )  # fmt: skip
    figure = next((drawing for section in sections for drawing in section.drawings), None)
    open_questions = [q for q in proposal.asked if q.key not in proposal.answers]
    return Page(
        f"Proposal: {proposal.name}",
        "Pellucid init",
        _headline(proposal, count, guesses),
        (
            Tile("recordings", str(len(proposal.recordings))),
            Tile("channels", str(count), more=f"{guesses} to confirm"),
            Tile("sampling rate", f"{rate:.4g}" if rate else "unknown", "Hz" if rate else ""),
            Tile("questions", str(len(proposal.asked)), more="each has a default"),
        ),
        sections if figure is None else without_drawing(sections, figure.name),
        f"Written by pellucid {version('pellucid')}. study.toml has a comment for each of these lines.",
        answer=Answer(
            "Do the files say all that a study needs?",
            "unsure" if open_questions or guesses else "yes",
            figure,
            (
                *(f"Answer: {q.text}" for q in open_questions[:3]),
                "Read each comment in study.toml that marks a guess. "
                f"Then check the study: `{printed_command('check', folder)}`.",
            ),
        ),
    )


def _headline(proposal: Proposal, count: int, guesses: int) -> str:
    what = (
        "a person's joints"
        if proposal.is_person
        else f"a joint with a {proposal.drive} drive"
        if proposal.drive
        else "motion"
    )
    if len(proposal.main.roles.joints) > 1 and not proposal.is_person:
        what = f"{len(proposal.main.roles.joints)} joints"
    decided = count - guesses
    return (
        f"The files hold {what}: {count} channels, {decided} of them decided by evidence and {guesses} to be confirmed."
    )


def _question_sections(proposal: Proposal) -> list[Section]:
    if not proposal.asked:
        return []
    rows = tuple(
        Row((q.text, proposal.answers.get(q.key, f"{q.default} (default)"), q.consequence)) for q in proposal.asked
    )
    table = Table(("Question", "Answer", "What hangs on it"), rows, wide=True)
    marked = tuple(f"Marked, not asked: {q.text} Taken: {q.default}." for q in proposal.marked)
    return [Section("questions", "What only you can know", tables=(table,), notes=marked)]


def _layout_section(layout: Layout, proposal: Proposal) -> Section:
    name = layout.stream or "recording"
    marks = {role.column: channel_mark(role, proposal) for role in layout.channels}
    rows = []
    for role in layout.roles.roles:
        channel = channel_name(role) if role.quantity is not None else "left out"
        why = "; ".join(dict.fromkeys(text for text in (role.why, role.unit_why) if text))
        mark = marks.get(role.column, "")
        rows.append(Row((role.column, channel, role.unit if role.quantity else "", mark, why), bool(mark)))
    clock = layout.roles.clock
    said = (
        f'Time is the column "{clock.column}" in {clock.unit}: {clock.why}.' if clock.column else f"Time: {clock.why}."
    )
    table = layout.tables[0]
    drawings = channel_figures(layout, table, f"channels_{layout.stream or 'main'}", marks)
    return Section(
        f"channels-{name}",
        "Channels" if not layout.stream else f"Channels of the stream {layout.stream}",
        (said,),
        (Table(("Column", "Channel", "Unit", "Mark", "Why"), tuple(rows), wide=True),),
        tuple(drawings),
    )


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
        sections.append(Section("remarks", "Left out and noticed", tuple(_sentence(text) for text in proposal.remarks)))
    return sections


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}" + ("" if text.endswith(".") else ".")
