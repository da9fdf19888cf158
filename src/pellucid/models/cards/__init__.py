"""Cards of servos and machines that were identified from public recordings.

``pl.cards.names()`` lists them, and ``pl.cards.load(NAME)`` returns one with its parameters, intervals, source and
licence.

>>> import pellucid as pl
>>> card = pl.cards.load("dynamixel-xl330")
>>> card["inertia"].unit
'kg*m^2'
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ..._errors import PellucidError
from ..card import CardParameter, ModelCard, named, read_card
from ..tree_card import TreeCard, read_tree_card

FOLDER = Path(__file__).parent
"""Folder of the cards and of their list."""


@dataclass(frozen=True)
class LibraryCard:
    """An identified machine of the library.

    Attributes
    ----------
    name : str
        Name in the library, such as ``"dynamixel-xl330"``.
    title : str
        What it is.
    card : ModelCard or TreeCard
        The model card of a joint, or of a robot of several joints.
    source : str
        Address of the recordings, at the version that was used.
    citation : str
        What to cite.
    licence : str
        Licence of the recordings. The card contains none of them.
    command : str
        Command that makes the card from the recordings.
    notes : tuple of str
        What to know before the numbers are used.
    load_inertia : float
        Known inertia of the load in the recordings, which the identified inertia contains [kg m^2 or kg].
    """

    name: str
    title: str
    card: ModelCard | TreeCard
    source: str
    citation: str
    licence: str
    command: str
    notes: tuple[str, ...] = ()
    load_inertia: float = 0.0

    @property
    def parameters(self) -> dict[str, CardParameter]:
        """Every identified parameter by name, with its unit, value, standard error and interval."""
        return {parameter.name: parameter for parameter in self.card.parameters}

    @property
    def confidence(self) -> float:
        """Confidence level of the intervals."""
        return self.card.confidence

    def __getitem__(self, name: str) -> CardParameter:
        return named(self.card.parameters, name, f"the card {self.name}")

    def __str__(self) -> str:
        lines = [self.title, *self.notes]
        lines += [
            f"{p.name} {p.value:.4g} {p.unit}, {self.confidence:.0%} interval {p.interval[0]:.4g} to "
            f"{p.interval[1]:.4g}"
            + ("" if p.identifiable else " (not identifiable)")
            for p in self.card.parameters
        ]
        return "\n".join([*lines, f"Cite: {self.citation}", f"Licence: {self.licence}"])


@cache
def library() -> Mapping[str, Mapping[str, Any]]:
    """Return the list of the cards by name."""
    return tomllib.loads((FOLDER / "library.toml").read_text(encoding="utf-8"))


def names() -> tuple[str, ...]:
    """Return the names of all cards.

    Examples
    --------
    >>> import pellucid as pl
    >>> "dynamixel-xl330" in pl.cards.names()
    True
    """
    return tuple(sorted(library()))


def load(name: str) -> LibraryCard:
    """Return a card of the library.

    Parameters
    ----------
    name : str
        One of `names`.

    Returns
    -------
    LibraryCard
        The card with its parameters, intervals, source, citation and licence.

    Raises
    ------
    PellucidError
        If the library has no such card.

    Examples
    --------
    >>> import pellucid as pl
    >>> card = pl.cards.load("dynamixel-xl330")
    >>> low, high = card["inertia"].interval
    >>> low < card["inertia"].value < high
    True
    """
    if name not in library():
        raise PellucidError(f"cards: found the name {name!r}, expected one of {', '.join(names())}")
    entry, path = library()[name], FOLDER / f"{name}.json"
    card: ModelCard | TreeCard = read_card(path) if entry["kind"] == "joint" else read_tree_card(path)
    return LibraryCard(
        name, entry["title"], card, entry["source"], entry["citation"], entry["licence"],
        f"python -m research.cards {name}", tuple(entry["notes"]), entry.get("load_inertia", 0.0),
    )  # fmt: skip
