"""Derive the exported law of a robot with several joints from its card."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256

from ..._errors import PellucidError
from ...models.tree_card import TreeCard, read_tree_card
from ...study.procedures.card_sources import require_fresh, source_notes
from ...study.study import Study
from ..instruments import Instruments
from ..joint_compensation import DEFAULT_PERIOD_S
from ..tree_laws import TreeLaw, carried, full_compensation, transparent

CARD_NAMES = ("tree.best.json", "tree.consistent.json", "tree.base.json")
"""File names of the cards that can be exported; the first one that exists is used."""

LAWS: Mapping[str, Callable[..., TreeLaw]] = {
    "carried": carried,
    "full": full_compensation,
    "transparent": transparent,
}
"""Laws that can be built from a card alone."""


@dataclass(frozen=True)
class TreeValues:
    """A law of several joints for one study."""

    law: TreeLaw
    cards: tuple[str, ...]  # file names in the study's models folder
    checksums: Mapping[str, str]  # SHA-256 of each card
    notes: tuple[str, ...]  # remarks that an engineer must read before switching on


def tree_values(
    study: Study,
    *,
    card: str | None = None,
    controller: str | None = None,
    period: float = DEFAULT_PERIOD_S,
    allow_outside: bool = False,
    instruments: Instruments | Sequence[Instruments] | None = None,
    start_up: bool = True,
) -> TreeValues:
    """Return the law of a robot's joints from a card that `identify` wrote.

    `card` is its file name in the models folder; None for the first of `CARD_NAMES` that exists. `controller` is a key
    of `LAWS`, and `period` that of the controller [s]. `instruments` are those of every joint, or one for each; None:
    encoders alone. `start_up` asks for the test of polarity and gain of one joint after the other.
    """
    if controller not in (None, *LAWS):
        raise PellucidError(f"export of {study.name}: found {controller!r}, expected one of {', '.join(LAWS)}")
    if allow_outside:
        study = replace(study, allow_outside=True)
    name = card or next((n for n in CARD_NAMES if study.card(n).is_file()), CARD_NAMES[0])
    path = study.card(name)
    found = require_fresh(study, path, read_tree_card(path))
    law = LAWS[controller or "carried"](found, period=period, instruments=instruments, start_up=start_up)
    notes = (*notes_of(found), *source_notes(name, found))
    return TreeValues(law, (name,), {name: sha256(path.read_bytes()).hexdigest()}, notes)


def notes_of(card: TreeCard) -> tuple[str, ...]:
    """Return remarks about the settings that a card does not determine."""
    notes = []
    for name, known, gain, unit in zip(card.names, card.ranges, card.gains, card.drive_units, strict=True):
        if known.low is None or known.high is None:
            notes.append(f"{name}: the study names no stops; set position_min, position_max and stop_margin.")
        if unit not in ("N*m", "N"):
            notes.append(f"{name}: the effort is that after the gears; its drive gives {gain:.6g} of it per {unit}.")
    return tuple(notes)
