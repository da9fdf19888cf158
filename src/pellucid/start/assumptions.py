"""What a proposal assumes: the defaults of questions that nobody answered, and the lines of study.toml that it guesses.

Both are read from the proposal and its study.toml, which marks them; nothing is decided here.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator

from ..study.answer import Assumption
from .proposal import Proposal
from .study_text import MARK_GUESS, channel_mark, channel_name, defaults_of, is_turned_effort

_GUESS_BEHIND_LINE = re.compile(rf"(?P<line>[^#\s].*?)  # {MARK_GUESS}(?:: (?P<why>.*))?")
_GUESS_ABOVE_LINE = re.compile(rf"# {MARK_GUESS}: (?P<why>.*)")

_PROPOSAL_FIGURE = " (the page shows the spectrum)"
"""Remark that refers to a figure of the proposal's page and is removed elsewhere."""


def assumptions_of(proposal: Proposal, text: str) -> tuple[Assumption, ...]:
    """Return the defaults that a proposal took, then the guessed lines of its study.toml, whose `text` is given."""
    # Several joints and recordings have the same guess in a line of each.
    return tuple(dict.fromkeys((*defaults_of(proposal), *_turned_efforts(proposal), *_guessed_lines(text))))


def _turned_efforts(proposal: Proposal) -> Iterator[Assumption]:
    """Yield the efforts whose sign was reversed, but for those whose line in study.toml is marked as a guess."""
    for role in proposal.main.channels:
        if is_turned_effort(role) and channel_mark(role, proposal) != MARK_GUESS:
            yield Assumption(f"{channel_name(role)}.sign", "-1", f'"{role.column}": {role.why}', False)


def _guessed_lines(text: str) -> Iterator[Assumption]:
    above: list[str] = []
    for line in text.splitlines():
        if found := _GUESS_ABOVE_LINE.fullmatch(line):
            above = [found["why"]]
        elif above and line.startswith("#"):
            above.append(line.lstrip("# "))
        elif above:
            yield _guess(line, " ".join(above).replace(_PROPOSAL_FIGURE, ""))
            above = []
        elif found := _GUESS_BEHIND_LINE.fullmatch(line):
            yield _guess(found["line"], found["why"] or "")


def _guess(line: str, why: str) -> Assumption:
    try:
        key, value = _first_leaf(tomllib.loads(line))
    except (ValueError, LookupError):
        return Assumption(line, "guessed", why, False)
    if isinstance(value, dict):
        unit = f" [{value['unit']}]" if value.get("unit", "1") != "1" else ""
        return Assumption(key, f'"{value["column"]}"{unit}' if "column" in value else str(value["rate"]), why, False)
    return Assumption(key, str(value), why, False)


def _first_leaf(table: dict[str, object]) -> tuple[str, object]:
    """Return the dotted key and the value of a line of TOML."""
    key, value = next(iter(table.items()))
    if isinstance(value, dict) and not {"column", "rate"} & set(value):
        rest, leaf = _first_leaf(value)
        return f"{key}.{rest}", leaf
    return key, value
