"""Model cards of a joint with a carriage: one method's model as a JSON file that can be read, reloaded and compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from .._errors import PellucidError
from .card import CARD_FORMAT, Card, CardParameter, read_table
from .directional_slider import DirectionalSliderModel
from .slider_joint import FRICTION_FAMILIES, SliderJointModel

SET_SIZE = 8  # parameters of one direction


@dataclass(frozen=True)
class SliderCard(Card):
    """An identified joint with a carriage: what `Card` says, and these.

    `family` is the method that identified it; `method` says it in words.
    """

    rail: tuple[float, float]  # Ends of the rail, from the axis [m]: beyond them the model is a guess
    drive: Mapping[str, float]  # `gain`, torque at the joint per ampere [N*m/A]
    heldout_error: float | None  # Mean absolute current error over the trials held out [A]
    residual_sd: float  # [N*m]
    processing: str
    confidence: float  # confidence level of the intervals
    notes: tuple[str, ...]
    checksums: Mapping[str, str]  # SHA-256 of the files it came from, by recording
    pellucid: str  # Version that wrote it
    joint: str = "joint"  # What study.toml calls it
    # Way from rest over which friction builds up before it slips [rad]; None where no recording showed it
    presliding_travel: CardParameter | None = None
    kind: str = field(default="slider")
    format: int = field(default=CARD_FORMAT)

    def stated_numbers(self) -> dict[str, float]:
        """See `Card.stated_numbers`."""
        return {**self.known, **self.drive}

    def model(self) -> DirectionalSliderModel | SliderJointModel:
        """The model whose free parameters the card's are; a directional one holds its values itself."""
        if self.family in FRICTION_FAMILIES:
            return SliderJointModel(self.family, dict(self.known))
        return DirectionalSliderModel(up=self.values[:SET_SIZE], down=self.values[-SET_SIZE:])


def read_slider_card(path: Path) -> SliderCard:
    """Read a card."""
    table = read_table(path)
    if table.get("kind") != "slider":
        raise PellucidError(f"{path}: not the model card of a joint with a carriage")
    card = SliderCard.from_table(table, path)
    found = len(card.parameters)
    try:
        low, high = card.rail
        if not 0.0 <= low < high <= 10.0:
            raise ValueError(f"rail: found {low:g} m to {high:g} m, expected two places on a segment")
        if card.presliding_travel is not None and not 0.0 <= card.presliding_travel.value <= 0.1:
            found_travel = card.presliding_travel.value
            raise ValueError(f"presliding_travel: found {found_travel:g} rad, expected 0 to 0.1")
        # A directional model has a set of parameters for each direction.
        model = card.model() if card.family in FRICTION_FAMILIES else None
        names = model.names if isinstance(model, SliderJointModel) else None
        if names is None and found not in (SET_SIZE, 2 * SET_SIZE):
            raise ValueError(f"found {found} parameters, expected {SET_SIZE} or {2 * SET_SIZE}")
        if names is not None and tuple(p.name for p in card.parameters) != tuple(names):
            raise ValueError(f"found {found} parameters, expected {', '.join(names)}")
    except ValueError as error:
        raise PellucidError(f"{path}: not a card that can be used: {error}") from None
    return card
