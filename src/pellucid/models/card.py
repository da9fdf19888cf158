"""Model cards: an identified joint as a JSON file that can be read by a person, reloaded, compared and deployed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from .._atomic import write_text_atomically
from .._errors import PellucidError, listed_names
from .._given import read_given
from .._printed_command import printed_command
from .card_schema import MAX_CARD_NUMBER, fields_of, require_between, require_sound
from .joint import FAMILIES, SYMBOLS_BY_NAME, JointModel

CARD_FORMAT = 1
"""Version of the card's layout; a reader refuses a newer one."""

MAX_NAMED_CARDS = 4
"""Largest number of other cards that the message about a missing card names."""

EFFORT_UNITS: Mapping[str, tuple[str, ...]] = {"rotary": ("N*m", "A", "V"), "prismatic": ("N", "A", "V")}
"""Units that an effort may have, by motion."""


@dataclass(frozen=True)
class CardParameter:
    """Value, standard error and interval of one parameter, in `unit`."""

    name: str
    unit: str
    value: float
    standard_error: float
    interval: tuple[float, float]
    at_bound: bool = False
    identifiable: bool = True
    statistical_error: float | None = None  # What coloured residuals alone make; None of old cards
    refused: str = ""  # Why the interval should not be read
    carried: float | None = None  # friction coefficient that a compensation uses; None in old cards


def named(parameters: Iterable[Any], name: str, where: str) -> Any:
    """Return the one of `parameters` that has this `name`; messages begin with `where`."""
    known = {parameter.name: parameter for parameter in parameters}
    if name not in known:
        raise KeyError(f"{where} has no parameter {name!r}; it has {', '.join(known)}")
    return known[name]


@dataclass(frozen=True)
class Card:
    """What every card says first, of whatever kind of joint."""

    study: str
    family: str
    method: str
    motion: str
    effort_unit: str  # "N*m", "N", "A" or "V"
    lifts: str  # What positive motion does
    parameters: tuple[CardParameter, ...]
    covariance: tuple[tuple[float, ...], ...]  # In the order of the parameters, SI
    known: Mapping[str, float]  # Parameters that were fixed beforehand, SI
    # What of it coloured residuals alone make, and two identifications of one joint differ by; () of old cards
    statistical: tuple[tuple[float, ...], ...] = field(default=(), kw_only=True)
    # Checksums of what it was made from, by name; empty of old cards, and of those of no study
    made_from: Mapping[str, str] = field(default_factory=dict, kw_only=True)

    def stated_numbers(self) -> dict[str, float]:
        """Return the numbers that the card states besides its parameters, by name."""
        return dict(self.known)

    @classmethod
    def from_table(cls, table: Mapping, path: Path) -> Self:
        """The card that a file's table holds."""
        try:
            card = cls(**fields_of(cls, table))
            for name, x in card.stated_numbers().items():
                require_between(name, x, -MAX_CARD_NUMBER, MAX_CARD_NUMBER)
        except ValueError as error:
            raise PellucidError(f"{path}: not a model card of format {CARD_FORMAT}: {error}") from None
        require_sound(path, card)
        return card

    def __post_init__(self):
        # A card may be a stranger's, and its units reach pages and source.
        if self.motion not in EFFORT_UNITS:
            raise ValueError(f"found the motion {self.motion!r}, expected one of {', '.join(EFFORT_UNITS)}")
        if self.effort_unit not in EFFORT_UNITS[self.motion]:
            raise ValueError(
                f"found the effort_unit {self.effort_unit!r}, expected one of {', '.join(EFFORT_UNITS[self.motion])}"
            )

    @property
    def values(self) -> np.ndarray:
        """Parameter values, shape (p,), SI."""
        return np.array([p.value for p in self.parameters])

    def __getitem__(self, name: str) -> CardParameter:
        return named(self.parameters, name, "this card")


@dataclass(frozen=True)
class ModelCard(Card):
    """An identified joint: what `Card` says, and these.

    Parameters
    ----------
    velocity_range : float
        Largest speed seen while fitting: beyond it the model is a guess [rad/s or m/s].
    drive : mapping of str to float
        `gain` (effort per command unit) and `back_emf`.
    heldout_effort_error : float or None
        [%]
    processing : str
    confidence : float
    checksums : mapping of str to str
        SHA-256 of the files it came from, by recording.
    pellucid : str
        Version that wrote it.
    joint : str
        What study.toml calls it.
    purpose : str
        What the estimator was chosen for, "torque" or "simulation"; empty where nothing was chosen.
    presliding_travel : CardParameter or None
        Way over which friction builds up to its level before the joint slips; None where recordings do not show it.
    """

    velocity_range: float
    drive: Mapping[str, float]
    heldout_effort_error: float | None
    processing: str
    confidence: float
    checksums: Mapping[str, str]
    pellucid: str
    joint: str = "joint"
    purpose: str = ""
    format: int = field(default=CARD_FORMAT)
    presliding_travel: CardParameter | None = None

    def stated_numbers(self) -> dict[str, float]:
        """See `Card.stated_numbers`."""
        return {**self.known, **self.drive}

    def model(self) -> JointModel:
        """The joint model whose free symbols the card's parameters are."""
        symbols = tuple(SYMBOLS_BY_NAME[p.name] for p in self.parameters)
        return JointModel(self.family, symbols, self.motion, self.effort_unit, dict(self.known))


def write_card(path: Path, card: Card) -> None:
    """Write a card as JSON, atomically.

    Raises
    ------
    PellucidError
        If a number of the card is not finite, such as that of a joint without inertia.
    """
    try:
        text = json.dumps(asdict(card), indent=2, allow_nan=False)
    except ValueError:
        raise PellucidError(
            f"{path.name}: found a model with a number that is not finite, expected finite ones: the recordings do not "
            "identify it"
        ) from None
    write_text_atomically(path, f"{text}\n")


def read_card(path: Path) -> ModelCard:
    """Read a card."""
    card = ModelCard.from_table(read_table(path), path)
    named = {p.name: p.value for p in card.parameters}
    unknown = [name for name in (*named, *card.known) if name not in SYMBOLS_BY_NAME]
    if unknown:
        raise PellucidError(
            f"{path}: unknown parameters {', '.join(unknown)}, expected any of {', '.join(SYMBOLS_BY_NAME)}"
        )
    try:
        if card.family not in FAMILIES:
            raise ValueError(f"found the family {card.family!r}, expected one of {', '.join(FAMILIES)}")
        require_between("velocity_range", card.velocity_range, 1e-9, 1e6)
        for name, value in (named | dict(card.known)).items():
            require_between(
                name,
                value,
                max(SYMBOLS_BY_NAME[name].lower, -MAX_CARD_NUMBER),
                min(SYMBOLS_BY_NAME[name].upper, MAX_CARD_NUMBER),
            )
        for p in card.parameters:
            unit = SYMBOLS_BY_NAME[p.name].unit(card.motion, card.effort_unit)
            if p.unit != unit:
                raise ValueError(f'{p.name}: found the unit "{p.unit}", expected "{unit}"')
    except ValueError as error:
        raise PellucidError(f"{path}: not a card that can be used: {error}") from None
    return card


def read_table(path: Path) -> dict:
    """What a card's file says, of whatever kind the card is."""
    try:
        table = json.loads(read_given(path).decode("utf-8"))
    except FileNotFoundError:
        # A card lies in the folder models of its study.
        command = printed_command("identify", path.parent.parent if path.parent.name == "models" else path.parent)
        others = sorted(each.name for each in path.parent.glob("*.json"))
        if not others:
            raise PellucidError(f"{path}: no such model card; make it with: {command}") from None
        named = listed_names(others, MAX_NAMED_CARDS)
        raise PellucidError(
            f"{path}: no such model card; found {named} in its folder, expected one of these, or a study.toml "
            "with the procedure that identifies it"
        ) from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, PellucidError):
            raise
        raise PellucidError(f"{path}: not a model card ({error})") from None
    version = table.get("format") if isinstance(table, dict) else None
    if not isinstance(version, int):
        raise PellucidError(
            f'{path}: not a model card: found no whole number "format", expected a file that `identify` wrote'
        )
    if version > CARD_FORMAT:
        raise PellucidError(
            f"{path}: found a model card of format {version}, expected up to {CARD_FORMAT}: a newer Pellucid wrote it, "
            "install that one"
        )
    return table
