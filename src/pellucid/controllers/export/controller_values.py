"""The numbers of one exported controller, with the source of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from ...models.anthropometry import Segment
from ...models.fields import COORDINATE_UNITS
from ..control_law import LAWS, ControlLaw
from ..instruments import Instruments
from ..supervised import SupervisedLaw, supervised
from ..worn import watched_worn
from .instruments_listing import ListedInstrument, list_instruments

NO_START_UP_TEST_NOTE = (
    "The limit of effort is too small for a test at start-up: a wave of that size might not move the joint. Polarity "
    "and gain of the drive are not tested: test them by hand, or set a larger effort in [rig.limits] and export again."
)
"""Note in the exported README if the controller has no test at start-up."""

NO_ANSWER_NOTE = (
    "The start-up test is not commissioned: it accepts a gain that is wrong by a factor of up to three. To measure its "
    "answer, check the drive by hand, let the robot start on a wearer who is at ease, and log position and effort of "
    "each period. The work in J is the sum of effort times the next change of the position over the first half of the "
    "wave, where the effort is positive; if the joint hardly moves there, over the second half. State the mean of ten "
    "starts as start_up_answer in [rig.instruments], and export again."
)
"""Note in the exported README if the start-up test has no answer of a commissioning."""

PROBE_NOTE = (
    "The controller asks drive and encoder with small waves of effort of 42, 75 and 108 Hz, which can be heard and "
    "felt. It judges their answers against those that you state as probe_answer in [rig.instruments]."
)
"""Note in the exported README if the supervisor probes and its answers at commissioning are known."""

UNCOMMISSIONED_PROBE_NOTE = (
    "The controller asks drive and encoder with small waves of effort of 42, 75 and 108 Hz, which can be heard and "
    "felt. It takes what they answer in the first movement after each start for right: a drive that is wrong from the "
    "start is then found by the test at start-up only. To state what is right, check the drive by hand, let a wearer "
    "who is at ease move the joint for twenty seconds, read pellucid_probe_answer, state the six numbers as "
    "probe_answer in [rig.instruments], and export again."
)
"""Note in the exported README if the supervisor probes and its answers at commissioning are not known."""


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
    body: Mapping[str, float] | None = None  # supervisor's model of the robot, SI; None for that of the law's numbers
    load: Segment | None = None  # load that is fastened to the robot, contained in the numbers
    supported: float = 0.0  # weight of limb and held load that the numbers carry [N*m]
    rest_friction: float | None = None  # friction at rest as identified, SI; None for that of the body

    @property
    def all_notes(self) -> tuple[str, ...]:
        """The notes, and what there is to say of the probe and of the start-up test."""
        supervision = self.supervised.supervision
        notes = self.notes
        if supervision["probe_effort"] > 0.0:
            known = supervision["probe_answer_error"] > 0.0
            notes = (*notes, PROBE_NOTE if known else UNCOMMISSIONED_PROBE_NOTE)
        tested = supervision["test_effort"] > 0.0
        if LAWS[self.law].drives_spring or not supervision["body_inertia"] > 0.0:
            return notes
        if not tested:
            return (*notes, NO_START_UP_TEST_NOTE)
        answered = self.instruments.start_up_answer is not None
        return notes if answered else (*notes, NO_ANSWER_NOTE)

    @property
    def listed_instruments(self) -> tuple[ListedInstrument, ...]:
        """The instruments that the supervisor was built for, in words."""
        return list_instruments(
            self.instruments,
            self.numbers["effort_limit"],
            coordinate=COORDINATE_UNITS[self.motion],
            effort=self.effort_unit,
            spring=LAWS[self.law].drives_spring,
        )

    @property
    def control_law(self) -> ControlLaw:
        """The law with its numbers."""
        return ControlLaw(self.law, self.numbers, self.uses, self.load, self.supported)

    @cached_property
    def supervised(self) -> SupervisedLaw:
        """The law with its supervisor, which tests the drive at start-up if the law's effort is that of the joint."""
        return (
            watched_worn(self.control_law, self.instruments)
            if LAWS[self.law].drives_spring
            else supervised(
                self.control_law, instruments=self.instruments, body=self.body, rest_friction=self.rest_friction
            )
        )
