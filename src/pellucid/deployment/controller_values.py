"""The numbers of one exported controller, with the source of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from ..control.control_law import LAWS, ControlLaw
from ..control.instruments import Instruments
from ..control.supervised import SupervisedLaw, supervised
from ..control.worn import watched_worn

NO_START_UP_TEST_NOTE = (
    "The limit of effort is too small for a test at start-up: a wave of that size might not move the joint. Polarity "
    "and gain of the drive are not tested: test them by hand, or set a larger effort in [rig.limits] and export again."
)
"""Note in the exported README if the controller has no test at start-up."""

PROBE_NOTE = (
    "The controller asks drive and encoder with small waves of effort of 42, 75 and 108 Hz, which can be heard and "
    "felt. It begins to judge their answers when the joint has moved once since the start."
)
"""Note in the exported README if the supervisor probes."""


@dataclass(frozen=True)
class ControllerValues:
    """A law of `control_law.LAWS` with its parameters for one study."""

    law: str  # name in `LAWS`
    numbers: Mapping[str, float]  # value of every parameter of the law, SI
    remarks: Mapping[str, str]  # source of each parameter: the interval on its card, or the reason of its choice
    cards: tuple[str, ...]  # file names in the study's models folder
    checksums: Mapping[str, str]  # SHA-256 of each card
    motion: str = "rotary"  # "rotary" or "prismatic"
    effort_unit: str = "N*m"  # "N*m", "N", "A" or "V"
    speed: float = 3.0  # largest speed in the recordings of the model, also that of the test vector [rad/s or m/s]
    notes: tuple[str, ...] = field(default=())  # remarks that an engineer must read before switching on
    uses: frozenset[str] = frozenset()  # names of the law's optional sensors that it uses
    instruments: Instruments = field(default_factory=Instruments)  # what the robot measures, how well

    @property
    def all_notes(self) -> tuple[str, ...]:
        """The notes, with further ones if the supervisor probes, and if it has no test at start-up."""
        supervision = self.supervised.supervision
        notes = (*self.notes, PROBE_NOTE) if supervision["probe_effort"] > 0.0 else self.notes
        tested = supervision["test_effort"] > 0.0 or not supervision["body_inertia"] > 0.0
        if LAWS[self.law].drives_spring or tested:
            return notes
        return (*notes, NO_START_UP_TEST_NOTE)

    @cached_property
    def supervised(self) -> SupervisedLaw:
        """The law with its supervisor, which tests the drive at start-up if the law's effort is that of the joint."""
        law = ControlLaw(self.law, self.numbers, self.uses)
        return (
            watched_worn(law)
            if LAWS[self.law].drives_spring
            else supervised(law, instruments=self.instruments, answer=self.instruments.start_up_answer)
        )
