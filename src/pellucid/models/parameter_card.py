"""Cards of what is no joint: a transfer function, a coupling, an orthosis, a map from EMG to torque."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from .._atomic import write_text_atomically
from .._errors import PellucidError
from .card import CARD_FORMAT, CardParameter, named, read_table
from .card_schema import fields_of, require_sound


@dataclass(frozen=True)
class ParameterCard:
    """Identified parameters with their uncertainty, as a JSON file.

    Attributes
    ----------
    kind : str
        ``"transfer_function"``, ``"hinge"``, ``"orthosis"``, ``"limb"``, ``"coupling"``, ``"strap"``,
        ``"torque_map"``.
    study : str
        The study's name.
    name : str
        Of the card's file, without its ending.
    parameters : tuple of CardParameter
        SI.
    covariance : tuple of tuple of float
        In the order of the parameters; empty where none was estimated.
    settings : Mapping[str, str, float, int or bool]
        What else a reader needs in order to use the parameters.
    processing : str
        What was done to the samples, in one line.
    confidence : float
        Of the intervals.
    checksums : Mapping[str, str]
        SHA-256 of the files it came from, by recording.
    pellucid : str
        Version that wrote it.
    joint : str
        Which one of the machine's it is of; empty where that is not said.
    made_from : Mapping[str, str]
        Checksums of what it was made from, by name; empty of old cards.
    """

    kind: str
    study: str
    name: str
    parameters: tuple[CardParameter, ...]
    covariance: tuple[tuple[float, ...], ...] = ()
    settings: Mapping[str, str | float | int | bool] = field(default_factory=dict)
    processing: str = ""
    confidence: float = 0.95
    checksums: Mapping[str, str] = field(default_factory=dict)
    pellucid: str = ""
    joint: str = ""
    made_from: Mapping[str, str] = field(default_factory=dict)

    @property
    def values(self) -> dict[str, float]:
        """Values by name, SI."""
        return {p.name: p.value for p in self.parameters}

    def __getitem__(self, name: str) -> CardParameter:
        return named(self.parameters, name, f"the card {self.name}")


def write_parameter_card(path: Path, card: ParameterCard) -> Path:
    """Write a card, whole or not at all; a number that is not finite becomes null."""
    text = json.dumps(_plain({"format": CARD_FORMAT, **asdict(card)}), indent=1, ensure_ascii=False)
    return write_text_atomically(path, text + "\n")


def read_parameter_card(path: Path) -> ParameterCard:
    """Read a card again."""
    table = read_table(path)
    try:
        plain = {key: value for key, value in table.items() if key != "format"}
        card = ParameterCard(**fields_of(ParameterCard, plain, missing=True))
    except ValueError as error:
        raise PellucidError(f"{path}: not a card of parameters: {error}") from None
    require_sound(path, card)
    return card


def _plain(value):
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
