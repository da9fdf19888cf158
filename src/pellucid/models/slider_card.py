"""Model cards of a joint with a carriage: one method's model as a JSON file that can be read, reloaded and compared."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from .._atomic import write_text_atomically
from .._errors import PellucidError
from .card import FORMAT, CardParameter, read_table
from .directional_slider import DirectionalSliderModel
from .slider_joint import FRICTIONS, SliderJointModel

SETS = 8  # parameters of one direction


@dataclass(frozen=True)
class SliderCard:
    """An identified joint with a carriage.

    Parameters
    ----------
    study, family, method : str
        `family` is the method that identified it; `method` says it in words.
    motion, effort_unit, lifts : str
        "rotary", "N*m", and what positive motion does.
    parameters : tuple of CardParameter
    covariance : tuple of tuple of float
        In the order of the parameters, SI.
    known : mapping of str to float
        Parameters that were fixed beforehand, SI.
    rail : tuple of float
        Ends of the rail, from the axis [m]: beyond them the model is a guess.
    drive : mapping of str to float
        `gain`, torque at the joint per ampere [N*m/A].
    heldout_error : float or None
        Mean absolute current error over the trials held out [A].
    residual_sd : float
        [N*m]
    processing : str
    confidence : float
        Of the intervals.
    notes : tuple of str
    checksums : mapping of str to str
        SHA-256 of the files it came from, by recording.
    pellucid : str
        Version that wrote it.
    """

    study: str
    family: str
    method: str
    motion: str
    effort_unit: str
    lifts: str
    parameters: tuple[CardParameter, ...]
    covariance: tuple[tuple[float, ...], ...]
    known: Mapping[str, float]
    rail: tuple[float, float]
    drive: Mapping[str, float]
    heldout_error: float | None
    residual_sd: float
    processing: str
    confidence: float
    notes: tuple[str, ...]
    checksums: Mapping[str, str]
    pellucid: str
    kind: str = field(default="slider")
    format: int = field(default=FORMAT)

    def model(self) -> DirectionalSliderModel | SliderJointModel:
        """The model whose free parameters the card's are; a directional one holds its values itself."""
        if self.family in FRICTIONS:
            return SliderJointModel(self.family, dict(self.known))
        return DirectionalSliderModel(up=self.values[:SETS], down=self.values[-SETS:])

    @property
    def values(self) -> np.ndarray:
        """Parameter values, shape (p,), SI."""
        return np.array([p.value for p in self.parameters])

    def __getitem__(self, name: str) -> CardParameter:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(f"{name!r}; this card has {', '.join(p.name for p in self.parameters)}")


def write_slider_card(path: Path, card: SliderCard) -> None:
    """Write a card as JSON, atomically.

    Parameters
    ----------
    path : Path
    card : SliderCard
    """
    write_text_atomically(path, json.dumps(asdict(card), indent=2, allow_nan=False) + "\n")


def read_slider_card(path: Path) -> SliderCard:
    """Read a card.

    Parameters
    ----------
    path : Path

    Returns
    -------
    SliderCard

    Raises
    ------
    PellucidError
        If the file is missing, is not the card of a joint with a carriage, or was written by a newer version.
    """
    table = read_table(path)
    if table.get("kind") != "slider":
        raise PellucidError(f"{path}: not the model card of a joint with a carriage")
    try:
        parameters = tuple(CardParameter(**(p | {"interval": tuple(p["interval"])})) for p in table["parameters"])
        covariance = tuple(tuple(row) for row in table["covariance"])
        rail, notes = tuple(table["rail"]), tuple(table["notes"])
        given = {"parameters": parameters, "covariance": covariance, "rail": rail, "notes": notes}
        card = SliderCard(**(table | given))
        expected = len(card.model().names) if card.family in FRICTIONS else len(parameters)
    except (KeyError, TypeError) as error:
        raise PellucidError(f"{path}: not a model card of format {FORMAT}: {error}") from None
    if len(parameters) != expected or not parameters:
        raise PellucidError(f"{path}: found {len(parameters)} parameters, expected {expected}")
    return card
