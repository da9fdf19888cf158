"""The numbers of one exported controller, and where each came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from ..control.control_law import ControlLaw
from ..control.supervised import SupervisedLaw, supervised
from ..control.worn import watched_worn

NO_TEST = (
    "The limit of effort is too small for a test at start-up: a wave of that size might not move the joint. Polarity "
    "and gain of the drive are not tested: test them by hand, or set a larger effort in [rig.limits] and export again."
)


@dataclass(frozen=True)
class ControllerValues:
    """A law of `control_law.LAWS` with its parameters for one study."""

    law: str  # Name in `LAWS`
    numbers: Mapping[str, float]  # Every parameter of the law, SI
    remarks: Mapping[str, str]  # By parameter: its card's value with interval, or why it was chosen
    cards: tuple[str, ...]  # File names in the study's models folder
    checksums: Mapping[str, str]  # SHA-256 of each card
    motion: str = "rotary"  # motion, effort_unit: "rotary" or "prismatic"; "N*m", "N", "A" or "V"
    effort_unit: str = "N*m"
    speed: float = 3.0  # Largest speed that the model was fitted on, that of the test vector [rad/s or m/s]
    notes: tuple[str, ...] = field(default=())  # What an engineer must know before switching on
    uses: frozenset[str] = frozenset()  # Of the law's optional sensors, those that it makes use of

    @property
    def all_notes(self) -> tuple[str, ...]:
        """The notes, and whether the supervisor has no test at start-up."""
        supervision = self.supervised.supervision
        if self.law == "worn" or supervision["test_effort"] > 0.0 or not supervision["body_inertia"] > 0.0:
            return self.notes
        return (*self.notes, NO_TEST)

    @cached_property
    def supervised(self) -> SupervisedLaw:
        """The law under the supervisor that goes with it, tested at start-up where its effort is the joint's."""
        law = ControlLaw(self.law, self.numbers, self.uses)
        return watched_worn(law) if self.law == "worn" else supervised(law)
