"""Which columns of a table describe how it was recorded: factors of the design, which are never tested as indices."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum

from .amplitude_check import MAX_AMPLITUDE_COUNT


class DesignRole(Enum):
    """What a column of the design says of a movement."""

    CELL_FACTOR = "which movements are alike"
    PERIOD_FACTOR = "when a condition came"
    TRIAL_FACTOR = "when a movement came within its condition"


DESIGN_WORDS: Mapping[str, DesignRole] = {
    **dict.fromkeys(("amplitude", "target", "direction"), DesignRole.CELL_FACTOR),
    "period": DesignRole.PERIOD_FACTOR,
    **dict.fromkeys(
        ("session", "visit", "day", "block", "run", "set", "repetition", "rep", "trial", "movement"),
        DesignRole.TRIAL_FACTOR,
    ),
}
"""Words that name a factor of the design, and its role; those of a trial from the slowest to the fastest."""

QUALIFIER_WORDS = frozenset((
    "number", "no", "nr", "num", "n", "id", "index", "idx", "label", "name", "code", "level",
    "angle", "position", "deg", "degree", "degrees", "rad", "m", "mm", "cm", "s", "of", "the",
))  # fmt: skip
"""Words that leave a factor one: its unit, its number, its label."""


def design_word(name: str) -> str:
    """Return the word of `DESIGN_WORDS` that the name of a column consists of, beside qualifiers; "" without one.

    >>> design_word("amplitude [deg]"), design_word("TrialNumber"), design_word("trial_duration")
    ('amplitude', 'trial', '')
    """
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)
    words = [part.lower() for part in parts]
    words = [word[:-1] if word[:-1] in DESIGN_WORDS else word for word in words]
    found = [word for word in words if word in DESIGN_WORDS]
    return found[-1] if found and all(word in DESIGN_WORDS or word in QUALIFIER_WORDS for word in words) else ""


def columns_with_role(names: Iterable[str], role: DesignRole) -> list[str]:
    """Return the columns with a role, in the order of `DESIGN_WORDS`."""
    words = {name: design_word(name) for name in names}
    order = list(DESIGN_WORDS)
    return sorted((n for n, w in words.items() if w and DESIGN_WORDS[w] is role), key=lambda n: order.index(words[n]))


def too_many_levels(levels: Sequence[object]) -> bool:
    """Return whether a factor has so many levels that no movements are alike by it: they were drawn at random."""
    return len(levels) > MAX_AMPLITUDE_COUNT
