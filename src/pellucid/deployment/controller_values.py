"""The numbers of one exported controller, and where each came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class ControllerValues:
    """A law of `control_law.LAWS` with its parameters for one study.

    Attributes
    ----------
    law : str
        Name in `LAWS`.
    numbers : mapping of str to float
        Every parameter of the law, SI.
    remarks : mapping of str to str
        By parameter: its card's value with interval, or why it was chosen.
    cards : tuple of str
        File names in the study's models folder.
    checksums : mapping of str to str
        SHA-256 of each card.
    motion, effort_unit : str
        "rotary" or "prismatic"; "N*m", "N", "A" or "V".
    speed : float
        Largest speed that the model was fitted on, that of the test vector [rad/s or m/s].
    notes : tuple of str
        What an engineer must know before switching on.
    """

    law: str
    numbers: Mapping[str, float]
    remarks: Mapping[str, str]
    cards: tuple[str, ...]
    checksums: Mapping[str, str]
    motion: str = "rotary"
    effort_unit: str = "N*m"
    speed: float = 3.0
    notes: tuple[str, ...] = field(default=())
