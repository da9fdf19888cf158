"""The numbers of one exported controller, with the source of each.

Combine the limits that a study states for its joint with default ones.

Derive the numbers of a joint's compensation from its card.

Derive the exported law of a robot with several joints from its card.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256

import numpy as np

from ..._errors import PellucidError
from ...models.anthropometry import Segment
from ...models.card import ModelCard, read_card, read_table
from ...models.fields import COORDINATE_UNITS
from ...models.slider_joint import SliderCard, read_slider_card
from ...models.tree_card import TreeCard, read_tree_card
from ...study.procedures.card_sources import require_fresh, source_notes
from ...study.recorded_motions import COMMAND_UNITS
from ...study.study import Study
from ...study.study_file import JointTable, SeveralJoints
from ..control_law import LAWS, ControlLaw, Limits
from ..instruments import COMMISSIONING_CONDITION, Instruments
from ..joint_compensation import (
    DEFAULT_PERIOD_S,
    EFFORT_RISE_S,
    WIDTH_SHARE,
    compensation,
    identified_remarks,
    known_speed,
    place_on_rail,
    rest_friction,
    suggested_limits,
)
from ..study.rig_instruments import rig_instruments
from ..supervised import PROBE_CREST, PROBE_CYCLES, SupervisedLaw, supervised
from ..supervisor_faults import UNMEASURED_FAULTS, undetectable_notes
from ..tree_laws import TreeLaw, carried, full_compensation, transparent
from ..worn import watched_worn
from .instruments_listing import ListedInstrument, list_instruments

NO_START_UP_TEST_NOTE = (
    "The effort limit is too small for a start-up test, because a test wave of that size might not move the joint. "
    "Polarity and gain of the drive are therefore not tested: test them by hand, or set a larger effort in "
    "[rig.limits] and export again."
)
"""Note in the exported README if the controller has no test at start-up."""

NO_ANSWER_NOTE = (
    "The start-up test is not commissioned: it accepts a drive gain that is wrong by a factor of up to four. "
    f"Commission the robot before it is worn. {COMMISSIONING_CONDITION} Log time, position and effort of ten starts; "
    "pellucid commission --log checks the drive, and writes their response as start_up_answer into "
    "[rig.instruments]. Then export again."
)
"""Note in the exported README if the start-up test has no answer of a commissioning."""

OTHER_ANSWER_NOTE = (
    "start_up_answer in [rig.instruments] was measured with another start-up test, and is not used: the test accepts "
    "a drive gain that is wrong by a factor of up to four. Commission with the --controller and --slider that you "
    "export, then export again."
)
"""Note in the exported README if the answer of the start-up test belongs to another wave."""

PROBE_NOTE = (
    "The supervisor probes drive and encoder with waves of effort of up to {size} at {waves}. The wearer hears a hum "
    "and feels the waves while the controller runs; inform the wearer beforehand. The supervisor compares the "
    "responses with probe_answer in [rig.instruments]."
)
"""Note in the exported README if the supervisor probes and its answers at commissioning are known."""

WEIGHED_PLACE_COUNT = 181
"""Number of positions at which the weight that a controller has to hold is computed."""

HEAVY_NOTE = (
    "**The controller cannot hold the joint everywhere**: the weight that it has to hold is up to {weight}, its effort "
    "limit {limit}. Hold the joint before it is switched on, or export with less load."
)
"""Note in the exported README if the weight exceeds the effort limit."""

SHAKING_CYCLE_SHARE = 0.6
"""Share of a cycle of a sine within which the check for sustained oscillation counts a travel: half of it, and the way
back by which it tells a turn."""

SHAKING_NOTE = (
    "The supervisor switches the power off if the joint oscillates faster than {frequency}, whatever slower motion is "
    "under it: four travels in a row beyond {travel}, or five beyond 0.55 times that. State shaking = false in "
    "[rig.instruments] if wearers oscillate that fast, and export again."
)
"""Note in the exported README if the supervisor checks for sustained oscillation."""

STILL_NOTE = (
    "While the encoder reads the same at rest, the supervisor adds a wave of effort, which grows to at most {effort} "
    "until the reading changes. If it does not within {time}, as with a blocked joint, the power is switched off."
)
"""Note in the exported README if the supervisor asks a joint at rest."""

UNCOMMISSIONED_PROBE_NOTE = (
    "The supervisor probes drive and encoder with waves of effort of up to {size} at {waves}. The wearer hears a hum "
    "and feels the waves while the controller runs; inform the wearer beforehand. Without commissioning, the "
    "responses in the first movement after each start are the reference: a fault from the start is detected by the "
    "start-up test "
    "only. pellucid commission measures what is right on the robot and states it as probe_answer in "
    "[rig.instruments]; then export again."
)
"""Note in the exported README if the supervisor probes and its answers at commissioning are not known."""


def largest_weight(numbers: Mapping[str, float]) -> float:
    """Return the largest weight that a controller compensates within its position limits, from all its numbers, SI."""
    low, high = numbers["position_min"], numbers["position_max"]
    if not (math.isfinite(low) and math.isfinite(high)):
        low, high = 0.0, math.tau
    q = np.linspace(low, high, WEIGHED_PLACE_COUNT)
    sine, cosine, offset = (
        numbers.get(name, numbers[f"body_{name}"]) for name in ("gravity_sine", "gravity_cosine", "offset")
    )
    weight = float(np.abs(sine * np.sin(q) + cosine * np.cos(q) + offset).max())
    return numbers.get("gravity_share", 1.0) * weight


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
        """The notes, and those on undetectable faults, on the probe and on the start-up test."""
        supervision = self.supervised.supervision
        notes = (*self.notes, *undetectable_notes(self.instruments, has_force_sensor="interaction" in self.uses))
        if supervision["probe_effort"] > 0.0:
            known = supervision["probe_answer_error"] > 0.0
            turns = [cycles / (supervision["probe_samples"] * self.numbers["period"]) for cycles in PROBE_CYCLES]
            waves = "{:.0f}, {:.0f} and {:.0f} Hz".format(*turns)
            largest = 2.0 * PROBE_CREST * supervision["probe_effort"]
            share = 100.0 * largest / self.numbers["effort_limit"]
            size = f"{largest:.2g} {self.effort_unit} ({share:.0f} % of the effort limit)"
            note = PROBE_NOTE if known else UNCOMMISSIONED_PROBE_NOTE
            notes = (*notes, note.format(size=size, waves=waves))
        unit, limit = COORDINATE_UNITS[self.motion], self.numbers["effort_limit"]
        weight = largest_weight({**supervision, **self.numbers})
        if weight > limit:
            told = {"weight": f"{weight:.3g} {self.effort_unit}", "limit": f"{limit:.3g} {self.effort_unit}"}
            notes = (HEAVY_NOTE.format(**told), *notes)
        if self.instruments.shaking:
            travel = f"{supervision['shaking_limit']:.2g} {unit}"
            frequency = f"{SHAKING_CYCLE_SHARE / supervision['shaking_time']:.2g} Hz"
            notes = (*notes, SHAKING_NOTE.format(travel=travel, frequency=frequency))
        if supervision["still_samples"] > 0.0:
            asked = 3.0 * supervision["still_samples"] * self.numbers["period"]
            effort = f"{supervision['still_effort']:.2g} {self.effort_unit}"
            notes = (*notes, STILL_NOTE.format(effort=effort, time=f"{asked:.2g} s"))
        tested = supervision["test_effort"] > 0.0
        if LAWS[self.law].drives_spring or not supervision["body_inertia"] > 0.0:
            return notes
        if not tested:
            return (*notes, NO_START_UP_TEST_NOTE)
        if self.instruments.answer_to(supervision["test_effort"]) is not None:
            return notes
        return (*notes, NO_ANSWER_NOTE if self.instruments.start_up_answer is None else OTHER_ANSWER_NOTE)

    @property
    def listed_instruments(self) -> tuple[ListedInstrument, ...]:
        """The instruments that the supervisor was built for, in words."""
        return list_instruments(
            self.instruments,
            self.numbers["effort_limit"],
            coordinate=COORDINATE_UNITS[self.motion],
            effort=self.effort_unit,
            spring=LAWS[self.law].drives_spring,
            sensors=self.uses,
            start_up_wave=self.supervised.supervision["test_effort"],
            probe_window=self.supervised.supervision["probe_samples"] * self.numbers["period"],
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
                self.control_law,
                instruments=self.instruments,
                body=self.body,
                rest_friction=self.rest_friction,
            )
        )


def protect_wearer(
    values: ControllerValues, *, probe: bool | None = None, unmeasured: bool = False, place: str = "export"
) -> ControllerValues:
    """Return the control law with a supervisor that checks its drive by a measurement or by a probe.

    Where no force sensor or spring shows what a drive adds, the supervisor also checks for sustained oscillation,
    unless the instruments state otherwise. `probe` is the choice of the caller. None: as the instruments state, and
    otherwise a probe if the drive is not measured and a wave that the encoder can resolve is small enough. `unmeasured`
    accepts a drive without measurement and probe. Errors begin with `place`.
    """
    instruments, spring = values.instruments, LAWS[values.law].drives_spring
    asked = instruments.probe if probe is None else probe
    decided = instruments.decided(has_force_sensor="interaction" in values.uses, spring=spring, probe=probe)
    probes = bool(decided.probe)
    stated = instruments.stated if probes == instruments.probe else instruments.stated - {"probe"}
    made = replace(values, instruments=replace(decided, stated=stated))
    if probes and spring:
        raise PellucidError(f"{place}: found probe, expected none: a controller of a series spring has no probe")
    if asked is False and not (instruments.drive or unmeasured):
        raise PellucidError(
            f"{place}: found a drive that is neither measured nor probed, expected [rig.instruments."
            f"drive_sensor]{' or spring_stiffness' if spring else ', or a probe'}; or --unmeasured (unmeasured=True), "
            f"which limits the detection of drive faults in simulation: {'; '.join(UNMEASURED_FAULTS)}"
        )
    if probes:
        try:
            _ = made.supervised
        except PellucidError as error:
            if asked is None:
                reason = str(error).removeprefix("probe: ")
                notes = (*values.notes, f"The supervisor has no probe of drive and encoder: {reason}.")
                return replace(values, instruments=replace(decided, probe=False), notes=notes)
            raise PellucidError(
                f"{place}: {error}. Instead of a probe, state a measurement in [rig.instruments.drive_sensor], or "
                "accept that many drive faults are not detected: --no-probe --unmeasured"
            ) from None
    return made


def limits_of(study: Study, otherwise: Limits) -> tuple[Limits, tuple[str, ...]]:
    """Return the limits of the safety gate, `otherwise` those that the study does not state, and notes about them."""
    given = study.rig.limits
    low, high = otherwise.position
    limits = Limits(
        effort=otherwise.effort if given.effort is None else min(given.effort, otherwise.effort),
        rate=otherwise.rate,
        velocity=otherwise.velocity if given.velocity is None else given.velocity,
        position=(
            float(low if given.position_min is None else given.position_min),
            float(high if given.position_max is None else given.position_max),
        ),
        stop_margin=otherwise.stop_margin,
        emg_torque=otherwise.emg_torque,
    )
    if given.position_min is not None and given.position_max is not None:
        return limits, ()
    low, high = limits.position
    return limits, (f"The study states no stops: {low:g} to {high:g} rad is a guess; set yours before switching on.",)


JOINT_CARD_NAMES = ("joint.json", "slider.load.json", "slider.consistent.json")
"""File names of the cards that a compensation can be built from; the first one that exists is used."""


def joint_values(
    study: Study,
    *,
    card: str | None = None,
    slider: float | None = None,
    period: float = DEFAULT_PERIOD_S,
    allow_outside: bool = False,
) -> ControllerValues:
    """Return the numbers that compensate gravity and friction, from a card that `identify` wrote.

    `card` is its file name in the study's models folder; None for the first of `CARD_NAMES` that exists. `slider` is
    the position of a carriage [m]; None for the middle of its rail. `period` is that of the controller [s], and
    `allow_outside` admits a card outside the study's folder.
    """
    if allow_outside:
        study = replace(study, allow_outside=True)
    default = JOINT_CARD_NAMES[study.rig.slider is not None]
    name = card or next((n for n in JOINT_CARD_NAMES if study.card(n).is_file()), default)
    path = study.card(name)
    read = read_slider_card if read_table(path).get("kind") == "slider" else read_card
    found = require_fresh(study, path, read(path))
    given = study.rig.limits
    try:
        usual = suggested_limits(found, slider)
        effort = usual.effort if given.effort is None else given.effort
        low, high = given.position_min, given.position_max
        limits = replace(
            usual,
            effort=effort,
            rate=effort / EFFORT_RISE_S,
            velocity=usual.velocity if given.velocity is None else given.velocity,
            position=(usual.position[0] if low is None else low, usual.position[1] if high is None else high),
            stop_margin=0.0 if low is None or high is None else 0.02 * (high - low),
        )
        law = compensation(found, slider=slider, limits=limits, period=period)
    except PellucidError as error:
        raise PellucidError(f"{path.name}: {error}") from None
    remarks = dict(identified_remarks(found))
    remarks["inertia"] += "; not carried"
    remarks |= {
        "velocity_width": f"{WIDTH_SHARE:.0%} of the largest recorded speed",
        "gravity_share": "chosen",
        "friction_share": "chosen: the remaining friction resists, so that the joint is not driven",
        "bandwidth": "chosen",
        "rate_limit": f"chosen: from 0 to the limit in {1e3 * EFFORT_RISE_S:g} ms",
        "max_age": "chosen: five periods",
        "max_repeats": "chosen",
    }
    chosen = {
        "effort_limit": (given.effort, "largest effort of this compensation at recorded speeds"),
        "velocity_limit": (given.velocity, "1.5 times the largest recorded speed"),
        "position_min": (given.position_min, "unknown: set yours"),
        "position_max": (given.position_max, "unknown: set yours"),
    }
    remarks |= {key: why if value is None else "from [rig.limits]" for key, (value, why) in chosen.items()}
    notes = source_notes(name, found)
    if isinstance(found, SliderCard):
        place = place_on_rail(found, slider)
        notes += (f"Inertia and gravity are valid only with the carriage at {place:.4g} m.",)
    if low is None or high is None:
        notes += ("The study states no stops: set position_min, position_max and stop_margin before switching on.",)
    return ControllerValues(
        law=law.kind,
        numbers=law.values,
        remarks=remarks,
        cards=(name,),
        checksums={name: sha256(path.read_bytes()).hexdigest()},
        motion=found.motion,
        effort_unit=found.effort_unit,
        speed=known_speed(found),
        notes=notes + drive_notes(found, study.rig),
        instruments=rig_instruments(study.rig),
        rest_friction=rest_friction(found, slider),
    )


def drive_notes(card: ModelCard | SliderCard, rig: JointTable | SeveralJoints) -> tuple[str, ...]:
    """Return a note with the gain from the drive's command to the effort, if it is known."""
    gain = card.drive.get("gain", 1.0)
    if gain == 1.0 or card.effort_unit not in ("N*m", "N") or rig.drive is None:
        return ()
    unit = COMMAND_UNITS.get(rig.drive.kind, card.effort_unit)
    return (f"The effort is the joint's. The drive gives {gain:.6g} {card.effort_unit} per {unit} of its command.",)


TREE_CARD_NAMES = ("tree.best.json", "tree.consistent.json", "tree.base.json")
"""File names of the cards that can be exported; the first one that exists is used."""

TREE_LAWS: Mapping[str, Callable[..., TreeLaw]] = {
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
    if controller not in (None, *TREE_LAWS):
        raise PellucidError(f"export of {study.name}: found {controller!r}, expected one of {', '.join(TREE_LAWS)}")
    if allow_outside:
        study = replace(study, allow_outside=True)
    name = card or next((n for n in TREE_CARD_NAMES if study.card(n).is_file()), TREE_CARD_NAMES[0])
    path = study.card(name)
    found = require_fresh(study, path, read_tree_card(path))
    law = TREE_LAWS[controller or "carried"](found, period=period, instruments=instruments, start_up=start_up)
    notes = (*notes_of(found), *source_notes(name, found))
    return TreeValues(law, (name,), {name: sha256(path.read_bytes()).hexdigest()}, notes)


def notes_of(card: TreeCard) -> tuple[str, ...]:
    """Return remarks about the settings that a card does not determine."""
    notes = []
    for name, known, gain, unit in zip(card.names, card.ranges, card.gains, card.drive_units, strict=True):
        if known.low is None or known.high is None:
            notes.append(f"{name}: the study states no stops; set position_min, position_max and stop_margin.")
        if unit not in ("N*m", "N"):
            notes.append(f"{name}: the effort is that behind the gears; its drive delivers {gain:.6g} per {unit}.")
    return tuple(notes)
