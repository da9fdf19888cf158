"""Say a proposal in lines of text: what was found, what is asked, what is left out."""

from __future__ import annotations

from .init_from_files import ProposedStudy
from .study_text import channel_mark, channel_name

MAX_LISTED_CHANNELS = 40
"""At most so many channels are listed in the terminal; the page has all."""


def proposal_lines(made: ProposedStudy) -> list[str]:
    """Return the lines that the command prints."""
    proposal = made.proposal
    rate = f"{proposal.rate:.5g} Hz" if proposal.rate else "a rate that no file states"
    count = len(proposal.recordings)
    lines = [f"{made.folder}: {count} {'recording' if count == 1 else 'recordings'} at {rate}."]
    for layout in (proposal.main, *proposal.streams):
        for role in layout.channels[:MAX_LISTED_CHANNELS]:
            mark = channel_mark(role, proposal)
            lines.append(
                f"  {role.column} -> {channel_name(role)} [{role.unit}]{f'  {mark}' if mark else ''}: {role.why}"
            )
        if len(layout.channels) > MAX_LISTED_CHANNELS:
            lines.append(f"  and {len(layout.channels) - MAX_LISTED_CHANNELS} more channels")
    for question in proposal.asked:
        answer = proposal.answers.get(question.key)
        lines.append(
            f"question {question.key}: {question.text} "
            + (
                f"Answer: {answer}."
                if answer
                else f'Default taken: {question.default}. --answer "{question.key}=..." changes it.'
            )
        )
    lines += [f"note: {text}" for text in proposal.remarks]
    lines.append(f"{made.page}: every channel drawn beside its role. {made.study_file} marks each guess.")
    return lines
