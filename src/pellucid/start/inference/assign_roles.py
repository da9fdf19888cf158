"""Assign to each column of a table what it is: evidence of names, units and numbers together, with the reasons."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from ...files.defects.magnitude import find_implausible
from ...files.file_facts import MUSCLE_FACT
from ...files.name_evidence import (
    JOINT_WORDS,
    QUANTITY_WORDS,
    NameEvidence,
    emg_muscle,
    is_emg_by_unit,
    motor_voltages,
    quantity_of_part,
    quantity_of_unit,
    read_name,
    with_stated_unit,
    words_of,
)
from ...files.recording import Channel
from ...units import to_si_factor
from .angle_units import (
    ANGLE_LIMITS,
    ENCODER_COUNTS,
    MAX_RADIAN_RANGE,
    AngleUnit,
    find_angle_unit,
)
from .clocks import FoundClock, find_clock
from .emg_spectrum import InertialColumns, find_inertial, is_envelope, is_raw_emg, swings_fast
from .encodings import Encoding, decode_counts, find_encoding
from .fingerprints import FingerprintColumn, MatchedFingerprint, find_fingerprint
from .joint_keys import JointKey, is_named_motor, joint_keys, matching_joint, side_of
from .motion_efforts import (
    DERIVATIVE_LIMITS,
    EFFORT_LIMITS,
    FULL_TURNS,
    DerivativePair,
    FollowedCommand,
    MotionSamples,
    effort_share,
    find_command,
    find_derivatives,
    find_leader,
    is_set_by_program,
    is_stepped,
    motion_samples,
    roughness,
    weigh_turns,
)

DRIVE_QUANTITIES = ("torque", "force", "current", "voltage", "duty")
"""Quantities of a drive."""

LENGTH_UNITS = ("m", "mm", "cm", "um")
"""Units of positions along a line."""

ESSENTIAL_QUANTITIES = (*DRIVE_QUANTITIES, "position", "motor_position", "angle", "moment", "emg")
"""Quantities that a study requires; a channel of another quantity is excluded if its unit is unknown."""

INERTIAL_QUANTITIES = {
    "acceleration": "linear_acceleration",
    "angular_velocity": "angular_velocity",
    "orientation": "orientation",
}
"""Quantities of inertial sensors, by the kind that numbers show."""

_INERTIAL_CHANNELS = frozenset({"acceleration", "angular_velocity", "orientation", "magnetic_field",
    "linear_acceleration"})  # fmt: skip
"""Quantities of inertial sensors, behind the name of the sensor, whose units are found with them."""

DEFAULT_UNITS = {
    "torque": "N*m", "force": "N", "current": "A", "voltage": "V", "duty": "1", "supply": "V", "temperature": "degC",
    "enabled": "1", "orientation": "1", "magnetic_field": "uT", "linear_acceleration": "m/s^2",
        "angular_velocity": "rad/s",
    "stiffness": "N*m/rad", "damping": "N*m*s/rad", "length": "m", "moment_arm": "m", "lengthening": "m/s",
}  # fmt: skip
"""Units that are taken, and marked, where nothing tells them."""

FINE_ENCODER_COUNTS = tuple(2**bits for bits in range(21, 25))
"""Counts per turn of servo-drive encoders, which are too fine for gravity to distinguish."""

_EFFORTS_BY_LETTER = {"v": "voltage", "u": "voltage", "i": "current", "t": "torque", "f": "force"}
"""Quantities of drives by the first letter of a short name that is no word."""


_OUTPUT_WORDS = frozenset({"joint", "output", "link", "load"})
"""Words for the output side of a gear: if a column has one, a motor's position is not the joint's."""


@dataclass(frozen=True)
class RoleLimits:
    """How much of a table is examined, and when its joints are in degrees."""

    # Evidence is taken from at most this many rows of a long table.
    max_analysed_rows: int = 200_000
    # Joints of one table whose ranges suggest both degrees and radians are in degrees if the largest range is above
    # this: no joint among several turns four times [rad].
    max_joints_range: float = 8.0 * np.pi
    # An angle's unit is looked for in the weight that at most so many efforts show.
    max_weighing_efforts: int = 8
    # Commands are looked for in at most this many pairs of columns, those of 60 columns; each takes a millisecond.
    max_compared_commands: int = 2000
    # A voltage that varies by at most this share of its mean is a supply.
    max_supply_spread: float = 0.2
    # Counts of a turn that a speed tells are those of a usual encoder within this share.
    counts_tolerance: float = 0.02
    # A position that ends within this share of its range from its start moves back and forth.
    max_one_way_share: float = 0.9
    # A motor and its joint turn in one ratio: what is left is at most this share of the angle's deviation, by play
    # and elasticity of the gear. Two joints of one machine are never so alike. Chosen by judgement.
    max_geared_residual: float = 0.02
    # A motor turns at least so many times for a turn of its joint. Sensors of one angle differ by less, and filters and
    # delays change a speed by far less.
    min_gear_turns: float = 1.5
    # Positions are compared among at most so many columns.
    max_geared_positions: int = 20
    # Of two sensors of one angle, the joint's leaves less of the effort unexplained. More than this many times as much
    # is no matter of noise. Chosen by judgement.
    max_unexplained_ratio: float = 1.2
    # Fits of efforts to motions are made for at most this many columns.
    max_effort_candidates: int = 40


ROLE_LIMITS = RoleLimits()


@dataclass(frozen=True)
class ColumnRole:
    """What a column is, and why."""

    column: str  # name of the column
    quantity: str | None  # first part of the channel's name, None if the column is left out
    unit: str  # unit of the numbers, as study.toml writes it
    why: str  # reasons for the role
    unit_why: str = ""  # reasons for the unit
    is_certain: bool = True  # whether the role is beyond doubt
    unit_is_certain: bool = True  # whether the unit is beyond doubt
    label: str = ""  # rest of the channel's name: a joint, a muscle, an IMU's axis
    is_command: bool = False  # whether it was asked for and not measured
    keys: Mapping[str, object] = field(default_factory=dict)  # further keys of the channel: signed_bits, scale, wrap
    unknown_unit: str = ""  # text that the file states as the unit, if no such unit is known
    fitting_unit: str = ""  # unit that the motion fits, if it refutes the one that the file states

    @property
    def is_guess(self) -> bool:
        """Whether the role or its unit is a guess that study.toml has to mark."""
        return self.quantity is not None and not (self.is_certain and self.unit_is_certain)

    @property
    def scale(self) -> float:
        """How many of its unit one stored number is."""
        return float(str(self.keys.get("scale", 1.0)))

    def scaled_unit(self, digits: int = 6) -> str:
        """Return the unit with how many of it one stored number is, as an answer states it: 0.00269 A."""
        if self.scale == 1.0:
            return self.unit
        return f"{np.format_float_positional(self.scale, digits, fractional=False, trim='-')} {self.unit}"

    @property
    def is_length(self) -> bool:
        """Whether its unit is one of lengths."""
        return self.unit in LENGTH_UNITS

    def in_unit(self, unit: str, why: str, is_certain: bool) -> ColumnRole:
        """Return the role with a unit, the reason for it, and whether it is certain."""
        return replace(self, unit=unit, unit_why=why, unit_is_certain=is_certain)


@dataclass(frozen=True)
class TableRoles:
    """The roles of a table's columns and its clock."""

    clock: FoundClock
    rate: float | None  # sampling rate [Hz]; None if nothing tells it
    roles: tuple[ColumnRole, ...]  # roles of all columns but the clock's, in the file's order
    joints: tuple[str, ...]  # names of the joints, empty for a single one without a name
    pairs: tuple[DerivativePair, ...] = ()
    commands: tuple[FollowedCommand, ...] = ()
    steady: tuple[ColumnRole, ...] = ()  # what the columns are that never change; they are left out as channels
    geared: Mapping[str, float] = field(default_factory=dict)  # positions of motors, and turns for one of the joint

    def of(self, quantity: str) -> list[ColumnRole]:
        """Return the measured roles of a quantity, in the file's order."""
        return [role for role in self.roles if role.quantity == quantity]


@dataclass(frozen=True)
class TableHints:
    """What is known of a table besides its columns."""

    units: Mapping[str, str] = field(default_factory=dict)  # units that the file states, by column
    angle_unit: str | None = None  # unit of all angles that the file's header states
    rate: float | None = None  # sampling rate that the file states [Hz]
    quantity: str | None = None  # quantity that the file's name or folder says of all its columns
    is_person: bool = False  # whether the recording is of a person's joints, without a drive
    shows_people: bool = False  # whether the files hold EMG, markers or a person
    joint: str | None = None  # joint that the file's name says of all its columns
    facts: Mapping[str, str] = field(default_factory=dict)  # settings that the file states
    clock_unit: str | None = None  # unit of the clock that the lab said, in place of the stated one


def assign_roles(columns: Mapping[str, np.ndarray], hints: TableHints | None = None) -> TableRoles:
    """Return the role of each of a table's columns, shape (n,) each.

    A constant column has no role. A clock advances evenly. EMG is recognised by its spectrum, inertial sensors by the
    relations between their axes, velocities as derivatives of positions, efforts by the motion that explains them, and
    commands by their lack of noise. Names add to this evidence. Where name and numbers disagree, or neither decides,
    the role is marked.
    """
    hints = hints or TableHints()
    n = max(map(len, columns.values()), default=0)
    names = {name: read_name(name) for name in columns}
    for name in motor_voltages(names):
        if names[name].unit is None:
            names[name] = replace(names[name], quantity="voltage")
    names = {name: with_stated_unit(evidence, hints.units.get(name)) for name, evidence in names.items()}
    printed = find_fingerprint(list(columns), hints.facts)
    if printed is not None:
        names = {name: _with_documented(evidence, printed.columns.get(name)) for name, evidence in names.items()}
    clock = find_clock(columns, list(names.values()))
    clock = clock if hints.clock_unit is None else clock.in_unit(hints.clock_unit, "said by the lab")
    rate = clock.rate or hints.rate
    time = _times(columns, clock, rate, n)
    return _Assignment(columns, names, hints, clock, rate, time, printed).run()


_QUANTITIES_ASKED_FOR = {
    "reference": "position", "desired_velocity": "velocity", "desired_torque": "torque", "desired_current": "current",
}  # fmt: skip
"""Quantities of commands, by the quantity that is asked for."""


def _with_documented(evidence: NameEvidence, documented: FingerprintColumn | None) -> NameEvidence:
    """Return what a name says, with the quantity that its logger's documentation gives it."""
    if documented is None:
        return evidence
    quantity = _QUANTITIES_ASKED_FOR.get(documented.quantity, documented.quantity)
    quantity = "state" if quantity == "ignore" else quantity
    stated = quantity_of_unit(evidence.unit) if evidence.unit is not None else None
    if stated is not None and quantity in ("position", "velocity", "torque", "force", "current") and stated != quantity:
        return evidence
    return replace(evidence, quantity=quantity, is_command=documented.is_command)


def _times(columns: Mapping[str, np.ndarray], clock: FoundClock, rate: float | None, n: int) -> np.ndarray:
    if clock.column is not None and np.isfinite(columns[clock.column]).all():
        times = clock.seconds(columns[clock.column])
        return np.maximum.accumulate(times) - times[0]
    return np.arange(n) / (rate or 1.0)


class _Assignment:
    """Roles of one table while they are found."""

    def __init__(self, columns, names, hints: TableHints, clock: FoundClock, rate, time, printed):
        self.printed: MatchedFingerprint | None = printed
        self._refuted: set[str] = set()  # columns whose documented unit the motion contradicts
        self.columns, self.hints, self.clock, self.rate = columns, hints, clock, rate
        self.names = names
        self.first = clock.first_sound
        rows = slice(self.first, self.first + ROLE_LIMITS.max_analysed_rows)
        self.time = time[rows]
        self.stored = {name: x[rows] for name, x in columns.items()}
        self.values = dict(self.stored)
        self.roles: dict[str, ColumnRole] = {}
        self._compared = 0  # pairs of columns of which one may be the other's command
        self._angles: dict[str, AngleUnit] = {}
        self._weights: dict[str, tuple[str, str, bool] | None] = {}
        self._shares: dict[str, float] = {}
        self._counts: dict[str, tuple[int, bool]] = {}  # counts of a turn by gravity, and whether it decides them
        self.pairs: list[DerivativePair] = []
        self.steady: list[ColumnRole] = []
        self.keys: dict[str, dict[str, object]] = {}
        self.commands: list[FollowedCommand] = []
        self.joints: tuple[str, ...] = ()
        self.geared: dict[str, float] = {}

    def run(self) -> TableRoles:
        self._leave_out_clocks_and_constants()
        self._decode_numbers()
        self._take_file_quantity()
        self._find_muscles()
        self._find_inertial_sensors()
        if not self.hints.is_person:
            self._find_derivatives()
            self._refute_units()
        self._take_names()
        # Of columns that a number alone tells apart, one motor's position makes all of them motors'.
        turning = {_stem(name) for name, role in self.roles.items() if role.quantity == "motor_position"}
        for name, role in self.roles.items():
            is_measured = role.quantity == "position" and not role.is_command
            is_told = self._stated(name) is not None or self._documented(name) is not None
            is_motor = is_measured and is_told and self._is_motor_side(name)
            if is_motor or (role.quantity == "position" and _stem(name) in turning):
                self.roles[name] = replace(role, quantity="motor_position")
        is_inertial = any((role.quantity or "").endswith(".acceleration") for role in self.roles.values())
        if not is_inertial:
            self._find_anonymous_motion()
        if not self.hints.is_person and not is_inertial:
            self._find_anonymous_efforts()
        self._find_supplies()
        self._find_commands()
        self._settle_units()
        for name, role in list(self.roles.items()):
            if role.unknown_unit and role.quantity not in ESSENTIAL_QUANTITIES:
                self._leave_out(name, role.unit_why)
        self._find_geared_positions()
        self._group_joints()
        roles = tuple(self.roles[name] for name in self.columns if name in self.roles)
        return TableRoles(
            self.clock, self.rate, roles, self.joints, tuple(self.pairs), tuple(self.commands), tuple(self.steady),
            self.geared,
        )  # fmt: skip

    def _angle(self, name: str) -> AngleUnit:
        """Return what a column's numbers tell of its unit as an angle, computed once."""
        if name not in self._angles:
            has_rollover = "wrap" in self.keys.get(name, {})
            self._angles[name] = find_angle_unit(self.stored[name] if has_rollover else self.values[name])
        return self._angles[name]

    def _documented(self, name: str) -> FingerprintColumn | None:
        """Return what the logger documents of a column; None if it says nothing, or if the motion refutes it."""
        if self.printed is None or name in self._refuted:
            return None
        return self.printed.columns.get(name)

    def _refute_units(self) -> None:
        """Drop documented units of velocities whose ratio to the position's derivative is another one."""
        for pair in self.pairs:
            of, by = self._documented(pair.of), self._documented(pair.by)
            if by is None or by.unit is None or by.unit.startswith("counts"):
                continue
            unit, turn = (of.unit, of.counts_per_turn) if of is not None else (self._stated(pair.of), None)
            if unit is None or (unit == "counts" and turn is None):
                continue
            per_unit = 2.0 * np.pi / turn if turn is not None else to_si_factor(unit, None)[0]
            scale = of.scale or 1.0 if of is not None else 1.0
            expected = per_unit * scale / (to_si_factor(by.unit, None)[0] * (by.scale or 1.0))
            if abs(abs(pair.ratio) / expected - 1.0) > DERIVATIVE_LIMITS.ratio_tolerance:
                self._refuted.add(pair.by)

    def _free(self) -> list[str]:
        return [name for name in self.columns if name not in self.roles and name != self.clock.column]

    def _leave_out(self, name: str, why: str) -> None:
        self.roles[name] = ColumnRole(name, None, "1", why)

    def _leave_out_clocks_and_constants(self) -> None:
        coarse = self.clock.coarse_column
        if coarse is not None:
            self._leave_out(coarse, self.clock.why)
        for name in self.clock.others:
            if name != coarse:
                self._leave_out(name, f'another clock, or a counter; time is "{self.clock.column or coarse}"')
        for name in self._free():
            x = self.values[name]
            known = x[np.isfinite(x)]
            if len(known) == 0:
                self._leave_out(name, "it has no numbers")
            elif np.ptp(known) == 0.0:
                if self.names[name].quantity is not None:
                    role = ColumnRole(name, self.names[name].quantity, "1", "it never changes")
                    self.steady.append(self._with_unit(name, role, None))
                self._leave_out(name, f"constant at {known[0]:.6g}: not a measurement")
            elif self.names[name].quantity in ("counter", "state"):
                self._leave_out(name, "its name is that of a counter, a state, or another quantity than a joint's")
            elif np.all(np.diff(known) == 1.0):
                self._leave_out(name, "it counts rows")

    def _decode_numbers(self) -> None:
        """Decode signs and rollovers, before columns are compared: an encoded number has jumps that no motion has."""
        for name in self._free():
            found = find_encoding(self.values[name], self._stated(name)) or self._documented_encoding(name)
            if found is not None:
                self.values[name] = found.values
                self.keys[name] = dict(found.keys)

    def _documented_encoding(self, name: str) -> Encoding | None:
        """Return the encoding that the logger documents, if the numbers need it."""
        documented = self._documented(name)
        if documented is None or documented.encoding is None:
            return None
        kind, _, bits = documented.encoding.partition(" ")
        keys = {"sign_bit": int(bits)} if kind == "sign_bit" else {"signed_bits": int(bits)}
        half = 2.0 ** (int(bits) - (kind != "sign_bit"))
        largest = float(np.nanmax(self.values[name]))
        if not half <= largest < 2.0 * half or float(np.nanmin(self.values[name])) < 0.0:
            return None
        return Encoding(decode_counts(self.values[name], keys), keys, "the logger documents it")

    def _take_file_quantity(self) -> None:
        """Take the quantity that the file's name says, for columns whose own names say a joint or a muscle alone."""
        said = self.hints.quantity
        if said in (None, "emg", "time"):
            return
        own_words = [e for e in self.names.values() if e.quantity in (*DRIVE_QUANTITIES, "position", "velocity")]
        if sum(e.joint is None and _is_long_name(e) for e in own_words) >= 2:
            return  # the columns say themselves what they are; the file's name tells a protocol
        for name in self._free():
            evidence = self.names[name]
            place = name.casefold()[-3:] in ("_tx", "_ty", "_tz")
            if place and said in ("angle", "position"):
                self._leave_out(name, "a position of the model's root, not an angle")
                continue
            if place and said == "torque" and evidence.quantity is None:
                self._leave_out(name, "a force on the model, not a moment")
                continue
            of_person = evidence.quantity == "position" and evidence.joint is not None
            own = evidence.quantity is None or of_person or (evidence.quantity == "emg" and evidence.muscle)
            if evidence.unit is not None or not own:
                continue
            quantity = "position" if said == "angle" else said
            if quantity == "position" and self._is_motor_side(name):
                quantity = "motor_position"
            if quantity == "velocity" and evidence.muscle:
                quantity = "lengthening"
            if quantity in ("length", "lengthening", "moment_arm") and not evidence.muscle:
                continue
            self._set(name, quantity, f"the file name contains {said}", evidence, True)

    def _find_muscles(self) -> None:
        if self.hints.quantity not in (None, "emg"):
            return
        rate = self.rate or 0.0
        free = self._free()
        envelopes = [n for n in free if self.names[n].quantity == "emg" and is_envelope(self.values[n], rate)]
        file_says = self.hints.quantity == "emg"
        for name in free:
            evidence, x = self.names[name], self.values[name]
            # Beside EMG a file may hold the force of the contraction.
            said = evidence.quantity == "emg" or (file_says and evidence.quantity not in ("force", "torque"))
            raw = is_raw_emg(x, rate) or (self.rate is None and swings_fast(x))
            # A name of another quantity stands against the spectrum: a current has ripple, too.
            if raw and (said or (evidence.quantity in (None, "voltage", "position") and not _is_long_name(evidence))):
                why = "its spectrum is that of EMG: broadband, between 20 and 450 Hz"
                if self.rate is None:
                    why = "it alternates about zero from sample to sample, as EMG does"
                named = f"{why}, and its name agrees"
                self._set(name, "emg", named if said else why, evidence, said or rate > 0)
            elif said and (name in envelopes or file_says or evidence.muscle):
                kind = "an envelope: slow and never negative" if is_envelope(x, rate) else "by its name"
                self._set(name, "emg", f"EMG, {kind}", evidence, True)
        units = [self._stated(name) for name, role in self.roles.items() if role.quantity == "emg"]
        for name in self._free():
            evidence = self.names[name]
            could_be = evidence.quantity in (None, "voltage", "emg")
            if could_be and is_emg_by_unit(name, self._stated(name), units):
                self._set(name, "emg", "EMG, by its name and the unit of other EMG channels", evidence, False)

    def _find_inertial_sensors(self) -> None:
        rate = self.rate or 1.0
        free = [
            name for name in self._free()
            if self.names[name].quantity in (None, "linear_acceleration", "angular_velocity", "orientation",
                "magnetic_field")
            and (self._stated(name) is None or self.names[name].quantity is not None)
        ]  # fmt: skip
        if len(free) < 3:
            return
        named = [name for name in free if self.names[name].quantity is not None]
        sensors = find_inertial(self.values, free, rate, named)
        for label, found in _numbered(sensors):
            axes = "xyz" if len(found.names) == 3 else "wxyz"
            for axis, name in zip(axes, found.names, strict=True):
                stated = self._stated(name)
                unit, why = (stated, "the file states it") if stated else (found.unit, found.why)
                self.roles[name] = ColumnRole(
                    name, f"{label}.{found.kind}", unit, found.why, why, True, found.is_certain or stated is not None,
                    axis,
                )  # fmt: skip

    def _find_derivatives(self) -> None:
        free = [n for n in self._free() if not _is_stepped_name(self.names[n], self.values[n])]
        if len(self.time) < 50 or self.rate is None:
            return
        found = find_derivatives({name: self.values[name] for name in free}, self.time, self._kinship)
        taken_by: set[str] = set()
        for pair in found:
            by, of = self.names[pair.by], self.names[pair.of]
            stated = quantity_of_unit(by.unit) if by.unit not in (None, "1", "counts") else None
            # Droop, an error or a second angle resembles a speed, and its unit says that it is none.
            if by.unit == "counts" or (stated and not stated.endswith(("velocity", "acceleration"))):
                continue
            if pair.by in taken_by or by.quantity in ("current", "voltage", "torque", "force", "duty", "position"):
                continue
            if of.quantity in ("current", "voltage", "torque", "force", "duty", "velocity"):
                continue
            self.pairs.append(pair)
            taken_by.add(pair.by)
        speeds = {pair.by for pair in self.pairs}
        for pair in self.pairs:
            quantity = "acceleration" if pair.of in speeds else "velocity"
            why = f'it is the derivative of "{pair.of}" (correlation {pair.correlation:.3f}, ratio {pair.ratio:.4g})'
            self._set(pair.by, quantity, why, self.names[pair.by], True)
        for pair in self.pairs:
            if pair.of not in self.roles:
                why = f'"{pair.by}" is its derivative'
                self._set(pair.of, "position", why, self.names[pair.of], True)

    def _kinship(self, of: str, by: str) -> float:
        """Return how much two columns' names say that one is the derivative of the other: by joint, side and kind."""
        first, second = self.names[of], self.names[by]
        sides = side_of(of), side_of(by)
        kin = 1.0 * (first.quantity == "position") + 1.0 * (second.quantity == "velocity")
        kin += 2.0 * (sides[0] == sides[1]) - 2.0 * (None not in sides and sides[0] != sides[1])
        kin -= 1.0 * (first.is_command != second.is_command)
        shared = set(words_of(self._alias(of))) & set(words_of(self._alias(by)))
        return kin + 0.5 * len(shared)

    def _take_names(self) -> None:
        for name in self._free():
            evidence = self.names[name]
            quantity = evidence.quantity or self._quantity_of_file(evidence)
            if quantity is None or quantity == "time":
                continue
            if quantity == "position" and self._is_motor_side(name):
                quantity = "motor_position"
            said = "its name" if evidence.quantity else "the file's name"
            documented = self._documented(name)
            said = f"{self.printed.name}: the documentation" if documented is not None and self.printed else said
            sure = _is_long_name(evidence) or evidence.unit is not None or quantity == self.hints.quantity
            sure = sure or documented is not None
            if quantity in ("torque", "force") and documented is None and self._is_register(name):
                why = (
                    f"{said} says {quantity}, but it has integers without a unit, as a servo's duty-cycle register has"
                )
                self._set(name, "duty", why, evidence, False)
                self.keys.setdefault(name, {})["scale"] = 0.001
                continue
            if quantity in DRIVE_QUANTITIES and not evidence.is_command and is_stepped(self.values[name]):
                why = f"{said} says {quantity}, but it has constant levels, as a command has"
                self._set(name, quantity, why, evidence, False)
                continue
            if quantity == "linear_acceleration" and evidence.axis is None:
                quantity = "acceleration"
            if quantity in ("linear_acceleration", "angular_velocity", "magnetic_field", "orientation"):
                sensor = "acceleration" if quantity == "linear_acceleration" else quantity
                label = evidence.axis or "x"
                self.roles[name] = ColumnRole(
                    name, f"imu.{sensor}", evidence.unit or DEFAULT_UNITS[quantity], f"{said} says so", "", sure,
                    evidence.unit is not None, label,
                )  # fmt: skip
                continue
            self._set(name, quantity, f"{said} says {quantity}", evidence, sure)

    def _is_motor_side(self, name: str) -> bool:
        """Whether a position is a motor's.

        Its name decides if its unit is stated and no joint position was recorded, or if another column is named after
        the joint. Otherwise the number of turns decides, in radians known from the encoder's resolution.
        """
        known = self.values[name][np.isfinite(self.values[name])]
        documented = self._documented(name)
        if documented is not None and documented.side == "motor" and documented.unit not in (None, "counts"):
            return True
        stated, spread = self._stated(name), float(np.ptp(known))
        if stated is not None:
            measured = [n for n, each in self.names.items() if each.quantity == "position" and not each.is_command]
            is_angle = is_known_unit(stated, "rad")
            return is_angle and all(is_named_motor(each) for each in (name, *measured))
        others = {word for each in self.names for word in words_of(each)}
        if is_named_motor(name) and _OUTPUT_WORDS & others:
            return True
        found = self._angle(name)
        is_wound = "wrap" in self.keys.get(name, {})
        return found.is_certain and not is_wound and found.unit == "rad" and spread > MAX_RADIAN_RANGE

    def _turns_often(self, name: str) -> bool:
        """Whether an angle in radians moves back and forth over more than two turns."""
        known = self.names[name].scale * self.values[name][np.isfinite(self.values[name])]
        spread, travel = float(np.ptp(known)), float(np.abs(known[-1] - known[0]))
        return spread > MAX_RADIAN_RANGE and travel < ROLE_LIMITS.max_one_way_share * spread

    def _is_register(self, name: str) -> bool:
        """Whether a column holds whole numbers without a unit, as a servo's register of load does."""
        known = self.values[name][np.isfinite(self.values[name])]
        is_unsigned = "signed_bits" in self.keys.get(name, {})
        has_supply = is_unsigned or any(evidence.quantity == "supply" for evidence in self.names.values())
        return has_supply and self._stated(name) is None and bool(np.all(known == np.round(known)))

    def _quantity_of_file(self, evidence: NameEvidence) -> str | None:
        if self.hints.quantity is not None:
            return self.hints.quantity
        return "position" if self.hints.angle_unit is not None and evidence.joint is not None else None

    def _motions(self, names: Iterable[str]) -> dict[str, MotionSamples]:
        """Return the motions of the measured positions and angles among `names`."""
        is_timeless = self.rate is None and self.clock.column is None
        time = np.arange(len(self.time)) / 100.0 if is_timeless else self.time
        found = {}
        for name in names:
            role = self.roles[name]
            if role.quantity in ("position", "angle") and not role.is_command and len(time) > 100:
                found[name] = motion_samples(self.values[name], time)
        return found

    def _find_anonymous_motion(self) -> None:
        """Where no column is a position yet, the smoothest column that others follow or answer is taken."""
        positions = [n for n, r in self.roles.items() if r.quantity in ("position", "angle", "motor_position")]
        free = [n for n in self._free() if not is_stepped(self.values[n])]
        if positions or not free or (any(r.quantity == "emg" for r in self.roles.values()) and len(free) > 6):
            return
        lengths = {n: roughness(self.values[n]) for n in free}
        # A pair in which one column follows the other is a controlled position.
        for i, a in enumerate(free):
            for b in free[i + 1 :]:
                followed = self._command_of(a, b)
                if followed is not None and max(lengths[a], lengths[b]) < 0.05 and abs(followed.slope - 1.0) < 0.1:
                    why = f"{followed.why}, as a controlled position does"
                    self._set(followed.measured, "position", why, self.names[followed.measured], False)
                    return
        drives = [n for n in self._free() if is_stepped(self.values[n])]
        efforts = [n for n, r in self.roles.items() if r.quantity in DRIVE_QUANTITIES]
        ranked = sorted(free, key=lambda n: (len(n.split(".")) > 1 and n.split(".")[-1].isdigit(), lengths[n]))
        has_encoder = [n for n in ranked if self._angle(n).is_certain]
        if has_encoder:
            # Without an effort beside them, all columns that an encoder divides are positions of joints.
            most = 2 * len(has_encoder) > len(ranked) and len(has_encoder) > 1
            found = ranked if most else has_encoder[:1]
            for name in sorted(found, key=list(self.columns).index):
                self._set(name, "position", self._angle(name).why, self.names[name], True)
        elif ranked and (drives or efforts or len(ranked) > 1 or any(r.quantity == "emg" for r in self.roles.values())):
            self._set(ranked[0], "position", "it is the smoothest column", self.names[ranked[0]], False)

    def _find_anonymous_efforts(self) -> None:
        motions = self._motions(self.roles)
        free = self._free()[: ROLE_LIMITS.max_effort_candidates]
        if not motions or not free:
            return
        has_drive = any(r.quantity in DRIVE_QUANTITIES and r.is_certain for r in self.roles.values())
        shares: dict[str, tuple[str, float]] = {}
        for name in free:
            # What follows a position is its command, and no effort.
            if any(self._follows(name, other) for other in motions):
                continue
            explained = {
                other: effort_share(self.values[name], motion, self._radians(other))
                for other, motion in motions.items()
            }
            shares[name] = max(explained.items(), key=lambda item: item[1])
        stepped = [n for n in shares if is_stepped(self.values[n])]
        plausible = stepped or [n for n, (_, share) in shares.items() if share >= EFFORT_LIMITS.min_effort_share]
        vectors = [n for n in plausible if not n.rpartition(".")[2].isdigit() or n.isdigit()]
        single = len(motions) == 1
        for name in (vectors or plausible)[: 1 if single and not has_drive else len(plausible)]:
            if single and has_drive:
                break
            other, share = shares[name]
            quantity, why = self._kind_of_effort(name)
            said = f'{why}; the motion "{other}" explains {100 * share:.0f} % of its variance'
            self._set(name, quantity, said, self.names[name], False)

    def _command_of(self, name: str, other: str) -> FollowedCommand | None:
        self._compared += 1
        if self._compared > ROLE_LIMITS.max_compared_commands:
            return None
        return find_command((name, self.values[name]), (other, self.values[other]))

    def _follows(self, name: str, other: str) -> bool:
        followed = self._command_of(name, other)
        return followed is not None and abs(followed.slope - 1.0) < 0.3

    def _radians(self, name: str) -> float | None:
        unit = self._position_unit(name)[0]
        return self.names[name].scale * 2.0 * np.pi / FULL_TURNS[unit] if unit in FULL_TURNS else None

    def _kind_of_effort(self, name: str) -> tuple[str, str]:
        x = self.values[name]
        largest = float(np.nanmax(np.abs(x)))
        if largest <= 1.0 + 1e-9 and np.sum(np.abs(x) > 0.999 * largest) > 5 and largest > 0.9:
            return "duty", "it saturates at 1, as a duty cycle does"
        if is_stepped(x) or is_set_by_program(x):
            return "voltage", "a program sets it: constant levels without noise, as of a commanded voltage"
        if quantity := self.hints.quantity:
            return quantity, "from the file name"
        letter = self.names[name].bare[:1].casefold()
        if len(self.names[name].bare) <= 4 and letter in _EFFORTS_BY_LETTER:
            quantity = _EFFORTS_BY_LETTER[letter]
            return quantity, f"an effort, and the letter {letter} stands for {quantity}"
        return "torque", "an effort"

    def _find_supplies(self) -> None:
        """Tell the supply of a drive from what drives it: it keeps its sign and its size."""
        voltages = [name for name, role in self.roles.items() if role.quantity == "voltage"]
        others = [n for n, r in self.roles.items() if r.quantity in DRIVE_QUANTITIES and n not in voltages]
        for name in voltages if others else ():
            known = self.values[name][np.isfinite(self.values[name])]
            if len(known) and known.min() > 0.0 and np.std(known) < ROLE_LIMITS.max_supply_spread * np.mean(known):
                why = "nearly constant and positive while another effort varies, as a supply voltage is"
                self.roles[name] = replace(self.roles[name], quantity="supply", why=why, is_certain=True)

    def _find_commands(self) -> None:
        """Tell references of positions and commands of efforts from measurements."""
        for name in self._free():
            evidence = self.names[name]
            for other, role in list(self.roles.items()):
                if role.quantity in ("position", "velocity") and not role.is_command:
                    followed = self._command_of(name, other)
                    if followed is not None and abs(followed.slope - 1.0) < 0.3:
                        quantity = "reference" if role.quantity == "position" else "desired_velocity"
                        why = f'"{other}" follows it: {followed.why}'
                        self.roles[name] = ColumnRole(name, quantity, role.unit, why, label=role.label, is_command=True)
                        self.commands.append(followed)
                        break
            if name not in self.roles and evidence.is_command:
                self._set(name, "reference", "its name says a command", evidence, False)
        self._find_leaders()
        for name, role in list(self.roles.items()):
            if role.is_command:
                continue
            if role.quantity == "position" and self.names[name].is_command:
                self.roles[name] = replace(role, quantity="reference", is_command=True, why="its name says a command")
            elif role.quantity in DRIVE_QUANTITIES and self.names[name].is_command:
                if any(self._is_measured(n, role.quantity) for n in self.roles if n != name):
                    self.roles[name] = replace(role, quantity=f"desired_{role.quantity}", is_command=True)
            elif role.quantity == "velocity" and self.names[name].is_command:
                self.roles[name] = replace(role, quantity="desired_velocity", is_command=True)
        for name in self._free():
            self._leave_out(name, "neither its name nor its numbers show its quantity")

    def _find_leaders(self) -> None:
        """Tell which of two columns of one quantity leads the other: the one is asked for, the other measured."""
        kept = {"position", "torque", "current"}
        names = [n for n, r in self.roles.items() if r.quantity in kept and not self.names[n].is_command]
        for a, b in combinations(names, 2):
            role, other = self.roles[a], self.roles[b]
            is_open = role.quantity == other.quantity and not (role.is_command or other.is_command)
            if not is_open or not self._may_be_one(a, b) or self._compared >= ROLE_LIMITS.max_compared_commands:
                continue
            self._compared += 1
            found = find_leader((a, self.values[a]), (b, self.values[b]))
            if found is None or self.names[found.command].is_measured:
                continue
            quantity = "reference" if role.quantity == "position" else f"desired_{role.quantity}"
            self.roles[found.command] = replace(
                self.roles[found.command], quantity=quantity, is_command=True, why=found.why
            )
            self.commands.append(found)

    def _may_be_one(self, a: str, b: str) -> bool:
        """Whether two columns of one unit may be a command and its measurement, and not two joints or two sensors."""
        one, other = self.names[a], self.names[b]
        words = [set(words_of(each.bare)) & {"left", "right", "l", "r"} for each in (one, other)]
        sides = side_of(a), side_of(b)
        is_one_joint = one.number == other.number and one.joint == other.joint and words[0] == words[1]
        is_one_side = None in sides or sides[0] == sides[1]
        return is_one_joint and is_one_side and one.unit == other.unit and _stem(a) != _stem(b)

    def _is_measured(self, name: str, quantity: str) -> bool:
        """Whether a column is a measurement of a quantity: neither asked for nor computed."""
        role, evidence = self.roles[name], self.names[name]
        return role.quantity == quantity and not (role.is_command or evidence.is_command or evidence.is_computed)

    def _settle_units(self) -> None:
        votes = []
        for name in self._unstated_angles():
            vote = self._position_unit(name)
            decided = self._weighed(name) if not vote[2] and self.roles[name].quantity != "reference" else None
            votes.append(vote if decided is None else (*decided, vote[3]))
        certain = {unit for unit, _, sure, _ in votes if sure and unit != "counts"}
        spans = [unit for unit, *_ in votes]
        # The joints of one table share their unit: what one of them shows for certain holds for all.
        common = certain.pop() if len(certain) == 1 else None
        if common is None and len(spans) > 1 and "deg" in spans and "rad" in spans and "counts" not in spans:
            known = [self.values[name][np.isfinite(self.values[name])] for name in self._unstated_angles()]
            spread = max(float(np.ptp(x)) for x in known if len(x))
            common = "deg" if spread > ROLE_LIMITS.max_joints_range else None
        for name, role in list(self.roles.items()):
            if role.quantity is None or role.quantity.partition(".")[2] in _INERTIAL_CHANNELS:
                continue
            self.roles[name] = self._with_unit(name, role, common)
        self._share_emg_unit()
        self._turn_velocities()
        for name, role in list(self.roles.items()):
            derived = role.quantity in ("velocity", "acceleration", "desired_velocity", "reference")
            if derived and not role.unit_is_certain:
                self.roles[name] = self._with_partner_unit(name, role)
        for name, role in list(self.roles.items()):
            unknown = self.names[name].unknown_unit
            if role.quantity is not None and unknown is not None:
                why = f'the file states the unknown unit "{unknown}"'
                self.roles[name] = replace(role, unknown_unit=unknown, unit_is_certain=False, unit_why=why)

    def _turn_velocities(self) -> None:
        """Give a velocity that counts the other way than its position the opposite sign."""
        for pair in self.pairs:
            role = self.roles.get(pair.by)
            if role is not None and role.quantity == "velocity" and pair.ratio < 0.0:
                why = f'{role.why}; its sign is opposite to that of "{pair.of}"'
                self.roles[pair.by] = replace(role, keys={**role.keys, "sign": -1}, why=why)

    def _unstated_angles(self) -> list[str]:
        return [
            name
            for name, role in self.roles.items()
            if role.quantity in ("position", "reference", "angle", "motor_position") and self._stated(name) is None
        ]

    def _share_emg_unit(self) -> None:
        """Give all EMG without a stated unit the unit of most: one amplifier has one unit."""
        names = [n for n, r in self.roles.items() if r.quantity == "emg" and self._stated(n) is None]
        units = [self.roles[name].unit for name in names]
        if not units:
            return
        common = max(sorted(set(units)), key=units.count)
        known = next(self.roles[name] for name in names if self.roles[name].unit == common)
        for name in names:
            if self.roles[name].unit != common:
                why = "same as the other EMG channels"
                self.roles[name] = self.roles[name].in_unit(common, why, known.unit_is_certain)

    def _stated(self, name: str) -> str | None:
        return self.names[name].unit

    def _position_unit(self, name: str) -> tuple[str, str, bool, AngleUnit | None]:
        stated = self._stated(name)
        if stated is not None:
            return stated, "the file states it", True, None
        if self.hints.angle_unit is not None:
            return self.hints.angle_unit, "the file's header states it", True, None
        documented = self._documented(name)
        if documented is not None and documented.unit is not None and self.printed is not None:
            return documented.unit, f"{self.printed.name} documents it", True, None
        found = self._angle(name)
        for pair in self.pairs:
            unit = self._stated(pair.by) if pair.of == name else None
            fitting = [a for a, b in pair.units if b == unit]
            if fitting:
                why = f'its derivative "{pair.by}" is in {unit}, at a ratio of {pair.ratio:.4g}'
                return fitting[0], why, True, None
        if name in self.keys and "wrap_bits" in self.keys[name]:
            return "counts", f"a count that rolls over after {self.keys[name]['wrap_bits']} bits", True, found
        return found.unit, found.why, found.is_certain, found

    def _with_unit(self, name: str, role: ColumnRole, common: str | None) -> ColumnRole:
        stated = self._stated(name)
        quantity = role.quantity or ""
        keys = dict(role.keys) | self.keys.get(name, {})
        if self.names[name].scale != 1.0:
            keys["scale"] = self.names[name].scale
        role = replace(role, keys=keys)
        if quantity in ("position", "reference", "angle", "target", "error", "motor_position"):
            unit, why, sure, found = self._position_unit(name)
            if stated is not None and is_known_unit(stated, "m") and _is_normalised(self.values[name]):
                why, sure = f"{why}, but its largest value is exactly 1, so that it may be normalized", False
            decided = None
            if sure and stated in FULL_TURNS and quantity == "position" and self.names[name].scale == 1.0:
                by_weight = self._weighed(name)
                if by_weight is not None and by_weight[0] != stated and by_weight[0] in FULL_TURNS:
                    why, sure = f"{why}, but {by_weight[1]}", False
                    role = replace(role, fitting_unit=by_weight[0])
            if sure and stated == "rad" and quantity == "position" and self._turns_often(name):
                # A wheel keeps turning in one direction; a joint moves back and forth within two turns.
                why = f"{why}, but it spans over two turns back and forth: it may be in degrees or a motor's"
                sure = False
            if stated is None and (not sure or unit == "counts") and quantity != "reference":
                decided = self._weighed(name)
            elif stated == "counts" and quantity in ("position", "motor_position"):
                self._weighed(name)  # the unit binds, and weight tells the counts of a turn
            if decided is not None:
                unit, why, sure = decided
            elif stated is None and common is not None and not sure:
                unit, why, sure = common, "same as the other angles of the table", True
            if found is not None and found.wrap is not None:
                keys["wrap"] = found.wrap
            documented = self._documented(name)
            if unit == "counts" and documented is not None and documented.counts_per_turn is not None:
                keys["counts_per_turn"] = documented.counts_per_turn
                sure = quantity not in ("position", "motor_position") or documented.side == "output"
            elif unit == "counts" and (by_speed := self._counts_by_speed(name)) is not None:
                known = self.values[name][np.isfinite(self.values[name])]
                # A motor's speed tells the turns of the motor: a joint turns less than twice.
                keys["counts_per_turn"], sure = by_speed, float(np.ptp(known)) < 2.0 * by_speed
            elif unit == "counts" and name in self._counts:
                keys["counts_per_turn"], sure = self._counts[name]
                # A file that states counts has an encoder that its lab knows: the weight gives the default.
                sure = sure and stated is None
            if documented is not None and documented.unit == unit and documented.scale is not None:
                keys["scale"] = documented.scale
            return role.in_unit(unit, why, sure)
        if stated is not None:
            return role.in_unit(stated, "the file states it", True)
        documented = self._documented(name)
        if documented is not None and documented.unit is not None and self.printed is not None:
            if documented.scale is not None:
                keys["scale"] = documented.scale
            is_open = bool(documented.other_scales)
            return role.in_unit(documented.unit, f"{self.printed.name} documents it", not is_open)
        if quantity == "emg":
            return role.in_unit(*_emg_unit(self.values[name], self.rate))
        if quantity in ("velocity", "acceleration", "desired_velocity"):
            return role.in_unit("rad/s" if quantity != "acceleration" else "rad/s^2", role.unit_why, False)
        return role.in_unit(*_unit_by_size(quantity.removeprefix("desired_"), self.values[name]))

    def _counts_by_speed(self, name: str) -> int | None:
        """Return the counts of a turn by a speed of which the unit is stated; None if there is none."""
        for pair in self.pairs:
            unit = self._stated(pair.by) if pair.of == name else None
            if unit is None or not is_known_unit(unit, "rad/s"):
                continue
            per_count = to_si_factor(unit, "rad/s")[0] * self.names[pair.by].scale * abs(pair.ratio)
            counts = 2.0 * np.pi / per_count
            usual = min((*ENCODER_COUNTS, *FINE_ENCODER_COUNTS), key=lambda known: abs(np.log(known / counts)))
            return usual if abs(usual / counts - 1.0) < ROLE_LIMITS.counts_tolerance else round(counts)
        return None

    def _weighed(self, name: str) -> tuple[str, str, bool] | None:
        """Return a position's unit by the weight of what it moves, with the reason and True; None if weight does not
        tell.

        Each unit is fitted with inertia, friction and gravity. Whole numbers may also be counts, of each division of a
        turn that encoders have; `_counts` then keeps the division that fits better than the usual one.
        """
        if name not in self._weights:
            self._weights[name] = self._weigh(name)
        return self._weights[name]

    def _weigh(self, name: str) -> tuple[str, str, bool] | None:
        if self.rate is None or len(self.time) < 200:
            return None
        x = self.values[name]
        known = x[np.isfinite(x)]
        is_whole = bool(np.all(known == np.round(known)))
        divisions = {f"{count} counts": float(count) for count in ENCODER_COUNTS} if is_whole else {}
        motion = motion_samples(x, self.time)
        efforts = [n for n, r in self.roles.items() if r.quantity in ("torque", "current", "voltage", "duty")]
        for other in efforts[: ROLE_LIMITS.max_weighing_efforts]:
            weighed = weigh_turns(self.values[other], motion, FULL_TURNS | divisions)
            if weighed is None:
                continue
            best = weighed.best
            if not weighed.is_decided(FULL_TURNS):
                continue
            unit = "counts" if best in divisions else best
            compared = dict.fromkeys((best, *FULL_TURNS))
            shares = ", ".join(f"{100 * weighed.left_share(each):.2g} % (in {each})" for each in compared)
            usual = f"{ANGLE_LIMITS.usual_counts} counts"
            if best in divisions and (weighed.is_decided() or weighed.beats(best, usual)):
                self._counts[name] = int(divisions[best]), weighed.is_decided()
            return unit, f'gravity, friction and inertia leave {shares} of "{other}" unexplained', True
        return None

    def _with_partner_unit(self, name: str, role: ColumnRole) -> ColumnRole:
        """Return a derivative's role with the unit that follows from its position's, by their ratio."""
        if role.quantity == "reference":
            for command in self.commands:
                partner = self.roles.get(command.measured)
                if command.command == name and partner is not None:
                    return role.in_unit(partner.unit, f'as "{command.measured}"', partner.unit_is_certain)
            measured = [r for r in self.roles.values() if r.quantity == "position"]
            if len(measured) != 1:
                return role
            (only,) = measured
            return role.in_unit(only.unit, f'as "{only.column}"', only.unit_is_certain)
        for pair in self.pairs:
            if pair.by != name:
                continue
            of = self.roles.get(pair.of)
            if of is None:
                continue
            for a, b in pair.units:
                if a == of.unit or (role.quantity == "acceleration" and f"{a}/s" == of.unit):
                    unit = f"{of.unit}^2" if role.quantity == "acceleration" else b
                    why = f'it is {pair.ratio:.4g} times the derivative of "{pair.of}"'
                    return role.in_unit(unit, why, of.unit_is_certain)
            if role.quantity == "acceleration":
                return replace(role, unit_why=f"no usual unit gives {pair.ratio:.4g} times the derivative")
            # A register in a unit of its own: the position gives its scale.
            why = f'one count is {1.0 / abs(pair.ratio):.4g} {of.unit}/s, from the derivative of "{pair.of}"'
            scaled = replace(role, keys={**role.keys, "scale": 1.0 / abs(pair.ratio)})
            return scaled.in_unit(f"{of.unit}/s", why, of.unit_is_certain)
        positions = [r for r in self.roles.values() if r.quantity == "position"]
        suffix = "/s^2" if role.quantity == "acceleration" else "/s"
        if positions and positions[0].unit in ("rad", "deg", "turn", "m", "mm"):
            return replace(role, unit=positions[0].unit + suffix, unit_why="the position's unit per second")
        return role

    def _find_geared_positions(self) -> None:
        """Tell the position of a motor from its joint's, where both have a unit and are in the ratio of a gear."""
        measured = [r for r in self.roles.values() if r.quantity == "position" and not r.is_command]
        angles = [r.column for r in measured if r.unit_is_certain and is_known_unit(r.unit, "rad")]
        efforts = [r.quantity for r in self.roles.values() if r.quantity in DRIVE_QUANTITIES and not r.is_command]
        # Joints that follow one command in different sizes have an effort each.
        if len(angles) <= max((efforts.count(each) for each in efforts), default=0):
            return
        for pair in combinations(angles[: ROLE_LIMITS.max_geared_positions], 2):
            if any(name not in self.roles or name in self.geared for name in pair):
                continue
            x, y = (to_si_factor(self.roles[n].unit, None)[0] * self.names[n].scale * self.values[n] for n in pair)
            good = np.isfinite(x) & np.isfinite(y)
            if good.sum() < 50 or np.ptp(x[good]) == 0.0 or np.ptp(y[good]) == 0.0:
                continue
            slope, rest = np.polyfit(x[good], y[good], 1)
            left = float(np.std(y[good] - slope * x[good] - rest)) / float(np.std(y[good]))
            turns = max(abs(slope), 1.0 / max(abs(slope), 1e-12))
            if left > ROLE_LIMITS.max_geared_residual or turns < ROLE_LIMITS.min_gear_turns:
                continue
            motor, joint = (pair[1], pair[0]) if abs(slope) > 1.0 else pair
            self.geared[motor] = float(turns)
            why = f'it turns {turns:.4g} times as far as "{joint}": a motor before a gear'
            self.roles[motor] = replace(self.roles[motor], why=why)
            self._make_extra(motor)

    def _group_joints(self) -> None:
        """Give each channel of several joints the name of its joint, and choose the main channel of a single one."""
        person = self.hints.is_person or self._are_persons_joints()
        by_quantity: dict[str, list[str]] = {}
        for name in self.columns:
            role = self.roles.get(name)
            if role is not None and role.quantity is not None and not _has_own_label(role):
                by_quantity.setdefault(role.quantity, []).append(name)
        if person:
            self._name_persons_joints(by_quantity)
            return
        named = self._joints_by_name(by_quantity)
        if named:
            self._label_joints(by_quantity, named)
            return
        motion = self._family(by_quantity.get("position", []) or by_quantity.get("motor_position", []))
        efforts = max((self._family(by_quantity.get(q, [])) for q in DRIVE_QUANTITIES), key=len)
        speeds = self._family(by_quantity.get("velocity", []))
        others = max(efforts, speeds, key=len)
        family = motion if len(motion) > 1 else others if len(others) > 1 and not by_quantity.get("position") else []
        if len(family) < 2:
            for names in by_quantity.values():
                self._choose_main(names)
            return
        joints = self._joint_names(family)
        self.joints = tuple(joints)
        for quantity, names in by_quantity.items():
            if len(names) > len(joints) and len(names) % len(joints) == 0 and quantity in DRIVE_QUANTITIES:
                self._split_blocks(quantity, names, joints)
                continue
            own = self._joint_names(names)
            for i, name in enumerate(names):
                if len(names) == len(joints) or own[i] in joints:
                    joint = joints[i] if own[i] not in joints or len(names) == len(joints) else own[i]
                    self.roles[name] = replace(self.roles[name], label=joint)
                else:
                    self._make_extra(name)

    def _are_persons_joints(self) -> bool:
        """Whether motions and moments recorded with EMG are a person's: by their names, or if no drive was recorded."""
        efforts = [n for n, r in self.roles.items() if r.quantity in DRIVE_QUANTITIES]
        if not any(r.quantity == "emg" for r in self.roles.values()):
            return False
        if any(self.roles[n].quantity != "torque" for n in efforts):
            return False
        # A torque that was asked for is a drive's, and so is one of an actuator.
        if any(evidence.is_machine for evidence in self.names.values()) or any(
            role.is_command and (role.quantity or "").startswith("desired_") for role in self.roles.values()
        ):
            return False
        named = [n for n in efforts if self.names[n].joint is not None or "moment" in words_of(self.names[n].bare)]
        return not efforts or bool(named)

    def _joints_by_name(self, by_quantity: Mapping[str, list[str]]) -> dict[str, JointKey]:
        """Return the keys of several joints by their names; empty for a single joint, or if names do not tell them.

        Each joint has a motion and an effort whose names share the words that tell the joints apart.
        """
        efforts = [n for q in DRIVE_QUANTITIES for n in by_quantity.get(q, [])]
        for base in ("position", "motor_position", "velocity"):
            names = by_quantity.get(base, [])
            outputs = [n for n in names if side_of(n) != "motor"]
            for chosen in (names, outputs):
                aliases = {self._alias(n): n for n in chosen}
                keys = joint_keys(list(aliases)) if len(aliases) == len(chosen) > 1 else {}
                found = {matching_joint(self._alias(effort), keys) for effort in efforts} - {None}
                if len(found) < 2:
                    continue
                made: dict[str, JointKey] = {}
                for i, alias in enumerate(n for n in aliases if n in found):
                    name = _plain_label(keys[alias].text) if keys[alias].text else f"joint_{i + 1}"
                    made[name if name not in made else f"joint_{i + 1}"] = keys[alias]
                return made
        return {}

    def _alias(self, name: str) -> str:
        """Return the part of a name that tells its joint, by the logger's documentation; else the whole name."""
        documented = self._documented(name)
        return documented.joint if documented is not None and documented.joint else name

    def _label_joints(self, by_quantity: Mapping[str, list[str]], keys: Mapping[str, JointKey]) -> None:
        """Give each column the name of its joint, and each joint one column of a quantity."""
        self.joints = tuple(keys)
        for quantity, names in by_quantity.items():
            of_joint: dict[str, list[str]] = {}
            for i, name in enumerate(names):
                joint = matching_joint(self._alias(name), keys)
                if joint is None and len(names) == len(keys):
                    joint = self.joints[i]
                if joint is None:
                    self._leave_out(name, f"a {quantity} that belongs to none of the joints {', '.join(keys)}")
                    continue
                of_joint.setdefault(joint, []).append(name)
            for joint, own in of_joint.items():
                self._choose_main(own)
                for name in own:
                    if self.roles[name].quantity is not None:
                        self.roles[name] = replace(self.roles[name], label=joint)

    def _family(self, names: Sequence[str]) -> list[str]:
        """Return the columns whose names differ by numbers or joints alone, or that have numbers for names."""
        families: dict[str, list[str]] = {}
        for name in names:
            role = self.roles[name]
            weak = not role.is_certain and not name.isdigit() and not _named_joint(self.names[name].bare)
            stem = "".join(c for c in self.names[name].bare.casefold() if not c.isdigit())
            joint = self.names[name].joint
            key = f"weak {name}" if weak else stem.replace(joint, "") if joint else stem
            families.setdefault(key, []).append(name)
        return max(families.values(), key=len, default=[])

    def _choose_main(self, names: list[str]) -> None:
        """Keep one column for a channel of a single joint, and give the others names of their own."""
        if len(names) < 2:
            return

        left = self._unexplained(names)
        most = ROLE_LIMITS.max_unexplained_ratio * min(left.values(), default=0.0)
        late = {name for name, rest in left.items() if rest > most}

        def merit(name: str) -> tuple[float, int]:
            own, still = self._merit(name)
            return own - 1.0 * (name in late), still

        best = max(names, key=merit)
        for name in names:
            if name != best:
                self._make_extra(name)

    def _merit(self, name: str) -> tuple[float, int]:
        """Return how much speaks for a column as the one of its quantity: its name, its side of a gear, the physics."""
        role, evidence = self.roles[name], self.names[name]
        words = set(words_of(evidence.bare))
        side = side_of(name)
        merit = 4.0 * role.is_certain
        merit += 2.0 * any(name in (pair.of, pair.by) for pair in self.pairs)
        # A part of what was asked for tells less than the whole.
        merit -= 3.0 * evidence.is_computed + 2.0 * evidence.is_command
        merit += 1.0 * (evidence.is_measured or bool({"real", "total"} & words))
        merit += 0.5 * (role.unit != "counts")
        # What is identified is the joint, behind its gear; a motor's own torque and current stand before it.
        merit += 2.5 * (side == "output") - 2.5 * (side == "motor" and role.quantity in ("position", "velocity"))
        # An electrical angle turns several times for each turn, and the direct current makes no torque.
        merit -= 4.0 * bool({"elec", "electrical"} & words)
        merit -= 3.0 * (role.quantity == "current" and "d" in words)
        if role.quantity in DRIVE_QUANTITIES:
            merit += 3.0 * self._explained(name)
        return merit, -self.roughly_still(name)

    def _explained(self, name: str) -> float:
        """Return the largest share of an effort that the motion of a column explains."""
        if name not in self._shares:
            motions = self._motions(self.roles)
            shares = [effort_share(self.values[name], m, self._radians(other)) for other, m in motions.items()]
            self._shares[name] = max(shares, default=0.0)
        return self._shares[name]

    def _unexplained(self, names: Sequence[str]) -> dict[str, float]:
        """Return the least share of an effort that the motion of each angle in a known unit leaves unexplained.

        An angle that is recorded late leaves more.
        """
        efforts = [n for n, r in self.roles.items() if r.quantity in DRIVE_QUANTITIES and not r.is_command]
        motions = self._motions(names) if efforts else {}
        return {
            name: 1.0 - max(effort_share(self.values[effort], motion, radians) for effort in efforts)
            for name, motion in motions.items()
            if (radians := self._radians(name)) is not None
        }

    def roughly_still(self, name: str) -> int:
        """Return the share of rows in which a column does not change [%]."""
        known = self.values[name][np.isfinite(self.values[name])]
        return round(100.0 * float(np.mean(np.diff(known) == 0.0))) if len(known) > 1 else 100

    def _make_extra(self, name: str) -> None:
        role = self.roles[name]
        has_unit = role.unit_is_certain or self._stated(name) == "counts"
        if not has_unit or not role.is_certain:
            self._leave_out(name, f"another {role.quantity} of uncertain meaning: {role.why}")
            return
        label = _plain_label(self.names[name].bare).casefold()
        # A further column may be named like a channel that a study reads.
        label = f"further_{label}" if label in ESSENTIAL_QUANTITIES or label in QUANTITY_WORDS else label
        self.roles[name] = replace(role, quantity=label, label="")

    def _name_persons_joints(self, by_quantity: dict[str, list[str]]) -> None:
        """Name angles and moments of a person's joints."""
        for quantity, kind in (("position", "angle"), ("torque", "moment")):
            for name in by_quantity.get(quantity, []):
                label = _named_joint(self.names[name].bare) or _plain_label(self.names[name].bare).casefold()
                self.roles[name] = replace(self.roles[name], quantity=kind, label=label)

    def _joint_names(self, names: Sequence[str]) -> list[str]:
        """Return the joints' names: those of people, numbers of columns, or their order."""
        named = [_named_joint(self.names[name].bare) for name in names]
        if all(named) and len(set(named)) == len(named):
            return [name for name in named if name]
        numbers = [self.names[name].number for name in names]
        plain = all(name.isdigit() for name in names)
        if not plain and None not in numbers and len(set(numbers)) == len(numbers):
            return [f"joint_{number}" for number in numbers]
        return [f"joint_{i + 1}" for i in range(len(names))]

    def _split_blocks(self, quantity: str, names: list[str], joints: list[str]) -> None:
        """Give blocks of efforts, one for each joint, their meaning: measured, and asked for in one or two units."""
        count = len(joints)
        blocks = [names[i : i + count] for i in range(0, len(names), count)]
        noise = [float(np.median([roughness(self.values[name]) for name in block])) for block in blocks]
        measured = int(np.argmax(noise))
        sizes = [np.array([np.std(self.values[name]) for name in block]) for block in blocks]
        for k, block in enumerate(blocks):
            gains = sizes[k] / np.maximum(sizes[measured], 1e-12)
            usual = float(np.median(gains))
            alike = 0.5 < usual < 2.0
            for joint, name in zip(joints, block, strict=True):
                role = replace(self.roles[name], label=joint)
                stated = self._stated(name)
                if k == measured and len(blocks) > 1:
                    larger = any(_is_larger(sizes[j], sizes[k]) for j in range(len(blocks)) if j != k)
                    kind = "current" if larger and stated is None else quantity
                    role = self._guessed(role, kind, kind, "an effort with noise, so that it is measured")
                elif alike:
                    kind = "current" if len(blocks) > 2 and stated is None else quantity
                    why = "an effort without noise, as large as the measured one: the command"
                    role = replace(self._guessed(role, f"desired_{kind}", kind, why), is_command=True)
                else:
                    kind = "torque" if stated is None else quantity
                    why = f"an effort without noise, {usual:.3g} times the measured one"
                    role = replace(self._guessed(role, f"desired_{kind}", kind, why), is_command=True)
                self.roles[name] = role

    def _guessed(self, role: ColumnRole, quantity: str, kind: str, why: str) -> ColumnRole:
        """Return a role with a quantity that is a guess; a unit that the file states stays."""
        stated = self._stated(role.column)
        return replace(
            role, quantity=quantity, unit=stated or DEFAULT_UNITS[kind], is_certain=False,
            unit_is_certain=stated is not None, why=why,
        )  # fmt: skip

    def _set(self, name: str, quantity: str, why: str, evidence: NameEvidence, certain: bool) -> None:
        label = ""
        if quantity == "emg":
            stated = self.hints.facts.get(f"{name}.{MUSCLE_FACT}", "")
            label = (emg_muscle(stated) or _plain_label(stated)) if stated else ""
            label = label or evidence.muscle or emg_muscle(name) or _plain_label(evidence.bare)
        elif quantity in ("length", "lengthening"):
            label = evidence.muscle or _plain_label(evidence.bare)
        elif quantity == "moment_arm":
            label = f"{evidence.joint or self.hints.joint or 'joint'}.{evidence.muscle or _plain_label(evidence.bare)}"
        if evidence.is_interaction and quantity in ("torque", "force"):
            quantity = "interaction"
        unit = evidence.unit or DEFAULT_UNITS.get(quantity, "1")
        self.roles[name] = ColumnRole(name, quantity, unit, why, "", certain, True, label)


def _stem(name: str) -> str:
    """Return a name without its digits."""
    return "".join(letter for letter in name.casefold() if not letter.isdigit())


def _is_larger(other: np.ndarray, own: np.ndarray) -> bool:
    return float(np.median(other / np.maximum(own, 1e-12))) > 3.0


def _has_own_label(role: ColumnRole) -> bool:
    return role.quantity is not None and (
        "." in role.quantity
        or role.quantity in ("emg", "length", "lengthening", "moment_arm", "supply", "temperature", "enabled")
    )


def _named_joint(bare: str) -> str | None:
    """Return the name of a person's joint with its direction and side, as a word of study.toml."""
    folded = bare.casefold()
    if not any(joint in folded for joint in JOINT_WORDS):
        return None
    for word in ("_moment", "_force", "moment", "_angle", "angle", "torque", "position"):
        folded = folded.replace(word, "")
    return _plain_label(folded)


def _plain_label(text: str) -> str:
    label = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "channel"
    return label if label[0].isalpha() else f"c{label}"


def _is_long_name(evidence: NameEvidence) -> bool:
    """Whether a name says its quantity by a word, and not by a letter that may stand for anything."""
    known = QUANTITY_WORDS.get(evidence.quantity or "", set())
    words = words_of(evidence.bare)
    joined = "".join(words)
    if any(len(word) >= 3 and word in known for word in words) or any(len(w) >= 4 and w in joined for w in known):
        return True
    return evidence.quantity is not None and quantity_of_part(joined) == evidence.quantity


def _is_stepped_name(evidence: NameEvidence, values: np.ndarray) -> bool:
    return evidence.quantity in ("temperature", "enabled", "state", "counter", "emg", "time") or is_stepped(values)


def _emg_unit(values: np.ndarray, rate: float | None) -> tuple[str, str, bool]:
    known = values[np.isfinite(values)]
    size = float(np.quantile(np.abs(known - np.median(known)), 0.999))
    if is_envelope(values, rate or 1000.0) and not (rate and is_raw_emg(values, rate)):
        if size <= 1.5:
            return "1", f"an envelope up to {np.max(known):.3g}: relative to a maximum", True
        if size <= 150.0:
            return "%", f"an envelope up to {np.max(known):.3g}: perhaps percent of a maximum", False
    for unit, low, high in (("V", 0.0, 0.012), ("mV", 0.012, 12.0), ("uV", 12.0, 12000.0)):
        if low < size <= high:
            return unit, f"surface EMG reaches a few millivolts, and the largest value is {size:.3g}", False
    return "uV", f"values up to {size:.3g} are microvolts or counts of an analog-to-digital converter", False


def _unit_by_size(quantity: str, values: np.ndarray) -> tuple[str, str, bool]:
    """Return a unit that nothing states, by the size of the numbers; it is never certain but where there is only
    one."""
    known = values[np.isfinite(values)]
    largest = float(np.max(np.abs(known))) if len(known) else 0.0
    whole = bool(np.all(known == np.round(known)))
    if quantity == "current":
        if largest > 100.0 or (whole and largest > 20.0):
            return "mA", f"values up to {largest:.4g} are too large for amperes", False
        return "A", f"numbers up to {largest:.4g}", False
    if quantity == "torque":
        is_much = find_implausible(Channel("torque", known, "N*m", "")) is not None or (whole and largest > 300.0)
        return ("mN*m" if is_much else "N*m"), f"numbers up to {largest:.4g}", False
    if quantity in ("voltage", "supply"):
        is_usual = quantity == "supply" and 3 < largest < 60
        return ("mV" if largest > 500.0 else "V"), f"numbers up to {largest:.4g}", is_usual
    if quantity == "duty" and largest > 100.0:
        return "1", f"integers up to {largest:.4g}; the number that stands for 100 % is unknown", False
    if quantity == "duty":
        return ("%" if 1.5 < largest <= 100.0 else "1"), f"numbers up to {largest:.4g}", largest <= 1.0
    if quantity in ("enabled", "orientation"):
        return "1", "", True
    if quantity == "temperature":
        return "degC", "", 5.0 < largest < 150.0
    if quantity in ("length", "moment_arm"):
        return "m", f"values up to {largest:.3g}, as muscle lengths in metres have", largest < 1.5
    if quantity in DEFAULT_UNITS:
        return DEFAULT_UNITS[quantity], f"numbers up to {largest:.4g}", False
    return "1", "", False


def _is_normalised(values: np.ndarray) -> bool:
    """Whether the largest magnitude of a column is exactly 1, as of a signal that was divided by its largest one."""
    return bool(np.nanmax(np.abs(values)) == 1.0)


def _numbered(sensors: list[InertialColumns]) -> list[tuple[str, InertialColumns]]:
    """Return inertial sensors with labels: the k-th sensor of each kind belongs to the k-th unit."""
    counts: dict[str, int] = {}
    counts_by_kind = {kind: sum(s.kind == kind for s in sensors) for kind in INERTIAL_QUANTITIES}
    # A gyroscope belongs to each unit; a further triple of gravity's length is something computed.
    total = counts_by_kind["angular_velocity"] or max(counts_by_kind.values(), default=0)
    labelled = []
    for sensor in sensors:
        k = counts.get(sensor.kind, 0)
        counts[sensor.kind] = k + 1
        label = ("proximal", "distal")[k] if total == 2 and k < 2 else "imu" if total == 1 and k == 0 else f"imu{k + 1}"
        labelled.append((label, sensor))
    return labelled


def is_known_unit(unit: str, expected: str) -> bool:
    """Whether a unit has the dimension of another one."""
    try:
        to_si_factor(unit, expected)
    except ValueError:
        return False
    return True
