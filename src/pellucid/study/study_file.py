"""The keys of study.toml, their units and their defaults.

Quantities are texts with a unit; they become SI numbers here. The docstring of a table explains each of its keys, and
``website/generated.py keys`` prints them all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from .._errors import IdentificationError, StudyError
from .._given import parse_toml, read_given
from ..files.cut import DEFAULT_CUT_SHARE
from ..files.recording import MAXIMAL_PROTOCOL
from ..models.joint import DEFAULT_FAMILIES, FAMILIES, SYMBOLS_BY_NAME
from ..units import parse_quantity, si_text, to_si_factor
from .instruments_table import InstrumentsTable, SessionTable
from .study_fields import (
    DERIVED_PREFIX,
    NAME_PATTERN,
    ProcedureTable,
    RelativePath,
    ShownText,
    StudyTable,
    Table,
    Word,
    quantity,
)
from .toml_place import explain_errors

MAX_FILE_BYTES = 3_000_000
"""A study.toml has at most this size [B]; Python's reader takes a second for each million bytes."""

# Gains that each kind of loop requires, and those that are optional.
_LOOP_GAINS = {
    "p": (("kp",), ()),
    "pi": (("kp", "ki"), ()),
    "pd": (("kp", "kd"), ()),
    "cascade": (("kp", "kv"), ("ki",)),
    "velocity_pi": (("kp", "ki"), ()),
}


MAX_KNOWN_MAGNITUDE = 1e5
"""Largest accepted magnitude of a known parameter [SI]. An industrial robot's first axis is below it."""


class Drive(StudyTable):
    """The joint's drive and how its effort is known: ``[rig.drive]``.

    Attributes
    ----------
    kind : str
        ``"torque"`` (a sensor), ``"current"`` or ``"voltage"``.
    torque_constant, force_constant : float or None
        Effort per ampere [N*m/A, N/A], or per volt for a voltage drive without a resistance [N*m/V, N/V].
        Without it, results are per ampere or per volt.
    gear_ratio : float
        Motor turns per turn of the joint; the constant times it is the effort at the joint.
    resistance : float or None
        Resistance of the winding [ohm]. The effort of a voltage drive is then k/R * voltage - k^2/R * velocity.
    supply : float or None
        Voltage at full duty [V], if the drive's command is recorded as a duty; a channel ``supply`` replaces it.
    limit : float or None
        Largest magnitude of the command, in the channel's SI unit.
    lowest_resonance : float or None
        Lowest resonance of the rotor and the joint behind the transmission, without a wearer [Hz]. From 45 Hz on,
        controllers with a force sensor have a gain of 1.5, otherwise 0.5.
    """

    kind: Literal["torque", "current", "voltage"]
    torque_constant: quantity("<constant>", gt=0, le=1e4) | None = None
    force_constant: quantity("<constant>", gt=0, le=1e6) | None = None
    gear_ratio: float = Field(1.0, ge=1e-5, le=1e5)
    resistance: quantity("ohm", gt=0, le=1e5) | None = None
    supply: quantity("V", gt=0, le=1e4) | None = None
    limit: quantity("<command>", gt=0) | None = None
    lowest_resonance: quantity("Hz", gt=0, le=1e5) | None = None

    @property
    def constant(self) -> float | None:
        """`torque_constant` of a rotary joint, `force_constant` of a prismatic one."""
        return self.torque_constant if self.torque_constant is not None else self.force_constant

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Drive:
        motion = (info.context or {}).get("motion")
        if self.torque_constant is not None and motion == "prismatic":
            raise ValueError('found torque_constant with motion = "prismatic", expected force_constant')
        if self.force_constant is not None and motion == "rotary":
            raise ValueError('found force_constant with motion = "rotary", expected torque_constant')
        if self.kind == "torque" and self.constant is not None:
            raise ValueError('found a constant with kind = "torque": a measured effort needs none; remove it')
        if self.resistance is not None and (self.kind != "voltage" or self.constant is None):
            raise ValueError('found resistance, expected it only with kind = "voltage" and a known constant')
        return self


class Loop(StudyTable):
    """The machine's own controller: ``[rig.loop]``. Gains are plain numbers in SI, in the drive's command unit.

    Attributes
    ----------
    kind : str
        With e = reference - position: ``"p"``, kp*e; ``"pi"``, kp*e + ki*integral of e; ``"pd"``, kp*e + kd*de/dt;
        ``"cascade"``, kv*f + ki*integral of f with f = kp*e - velocity. ``"velocity_pi"`` is ``"pi"`` with a
        reference and an error of velocity.
    kp, ki, kd, kv : float or None
        Gain of the command's formula for this `kind`.
    limit : float or None
        Largest magnitude of the command, in its SI unit.
    injected : str or None
        Channel that is added to the command after the limit.
    velocity_span : int
        Number of samples over which the machine differentiates position to get its velocity; 0 if it is not known.
    period : float or None
        Period of the controller [s]; None for the recording's own.
    """

    kind: Literal["p", "pi", "pd", "cascade", "velocity_pi"]
    kp: float | None = None
    ki: float | None = None
    kd: float | None = None
    kv: float | None = None
    limit: quantity("<command>", gt=0) | None = None
    injected: Word | None = None
    velocity_span: int = Field(0, ge=0)
    period: quantity("s", gt=0) | None = None

    @model_validator(mode="after")
    def _gains(self) -> Loop:
        needed, optional = _LOOP_GAINS[self.kind]
        missing = [gain for gain in needed if getattr(self, gain) is None]
        used = {*needed, *optional}
        unused = [gain for gain in ("kp", "ki", "kd", "kv") if gain not in used and getattr(self, gain) is not None]
        if missing or unused:
            found = f"missing {', '.join(missing)}" if missing else f"unused {', '.join(unused)}"
            raise ValueError(f'kind = "{self.kind}" expects the gains {", ".join(needed)}: {found}')
        return self


def _unit_vector(direction: tuple[float, float, float] | None) -> tuple[float, ...] | None:
    if direction is None:
        return None
    length = math.hypot(*direction)
    if length == 0.0:
        raise ValueError("found [0, 0, 0], which points nowhere, expected a direction such as [0, 0, -1]")
    return tuple(x / length for x in direction)


def _each_once(names: tuple) -> tuple:
    if not names or len(set(names)) < len(names):
        raise ValueError(f"found {list(names)}, expected at least one, each once")
    return names


if TYPE_CHECKING:
    LengthInMetres = float
    AngleInRadians = float
    PositionInMetres = tuple[float, float, float]
else:
    LengthInMetres = quantity("m")
    AngleInRadians = quantity("rad")
    PositionInMetres = tuple[LengthInMetres, LengthInMetres, LengthInMetres]


class JointLimits(StudyTable):
    """Limits of the joint: ``[rig.limits]``. All keys are optional.

    Attributes
    ----------
    position_min, position_max : float or None
        End of the range of motion [rad or m].
    velocity : float or None
        Largest speed [rad/s or m/s].
    effort : float or None
        Largest effort [N*m or N].
    """

    position_min: quantity("<coordinate>") | None = None
    position_max: quantity("<coordinate>") | None = None
    velocity: quantity("<velocity>", gt=0) | None = None
    effort: quantity("<effort>", gt=0) | None = None

    @model_validator(mode="after")
    def _ordered(self) -> JointLimits:
        low, high = self.position_min, self.position_max
        if low is not None and high is not None and low >= high:
            raise ValueError(f"found position_min = {low:g}, expected it below position_max = {high:g}")
        return self


class Slider(StudyTable):
    """A carriage that moves freely on a rail along the moving segment: ``[rig.slider]``.

    Attributes
    ----------
    low, high : float
        Distances of the rail's ends from the joint's axis along the segment [m].
    marker : str or None
        Marker on the carriage, one of ``[optical]``'s; None if every position is measured with a ruler.
    mass : float or None
        Weighed mass of the carriage [kg]. It separates friction while the motor drives from friction while the load
        drives.
    """

    low: quantity("m", ge=0)
    high: quantity("m", gt=0)
    marker: ShownText | None = None
    mass: quantity("kg", gt=0) | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Slider:
        if self.low >= self.high:
            raise ValueError(f"found low = {self.low:g} m not below high = {self.high:g} m, expected low < high")
        return self


class JointTable(StudyTable):
    """One joint of the machine.

    Attributes
    ----------
    motion : str
        ``"rotary"``, with rad and N*m, or ``"prismatic"``, with m and N.
    lifts : str
        Effect of a positive motion, such as ``"flexion"``. A rotary joint is at 0 where the moving segment hangs.
    moving_mass : float or None
        Upper limit of the mass that moves about a rotary axis [kg]; it bounds the inertia from below.
    drive : Drive or None
        Source of the effort; None without a motor.
    loop : Loop or None
        The machine's own controller, with which simulations close the loop; None if it is not known.
    limits : JointLimits
        Limits of position, velocity and effort.
    slider : Slider or None
        Carriage on the moving segment; None if there is none.
    instruments : InstrumentsTable
        Sensors of the robot and their accuracy, from which the thresholds of the supervisor follow.
    """

    motion: Literal["rotary", "prismatic"]
    lifts: ShownText = ""
    moving_mass: quantity("kg", gt=0) | None = None
    drive: Drive | None = None
    loop: Loop | None = None
    limits: JointLimits = JointLimits()
    slider: Slider | None = None
    instruments: InstrumentsTable = InstrumentsTable()

    @model_validator(mode="after")
    def _slider_turns(self) -> JointTable:
        if self.slider is not None and self.motion != "rotary":
            raise ValueError(f'found [rig.slider] with motion = "{self.motion}", expected "rotary"')
        return self

    @property
    def joints(self) -> tuple[JointTable, ...]:
        """This joint alone, so that a machine of one joint can be used like a machine of several."""
        return (self,)


class OneJoint(JointTable):
    """The machine, if it has one joint: ``[rig]``.

    Attributes
    ----------
    joint : str
        Name of the joint in texts and figures.
    """

    joint: Word = "joint"

    @model_validator(mode="after")
    def _encoder_is_there(self) -> OneJoint:
        self.instruments.require_encoder()
        return self


class Body(StudyTable):
    """The body that a joint carries: ``[rig.joints.body]``.

    Attributes
    ----------
    mass : float
        Mass of the body [kg].
    centre : tuple of float
        Centre of mass in the joint's frame [m]; with `dh`, in the frame after the row.
    inertia : tuple of float
        I_xx, I_xy, I_xz, I_yy, I_yz and I_zz about the centre of mass, along the frame's axes [kg m^2].
    """

    mass: quantity("kg", gt=0)
    centre: PositionInMetres = (0.0, 0.0, 0.0)
    inertia: tuple[(quantity("kg*m^2"),) * 6] = (0.0,) * 6


class DenavitHartenberg(StudyTable):
    """A joint's row of Denavit and Hartenberg: ``[rig.joints.dh]``. `dh` in ``[tree]`` states the convention.

    Attributes
    ----------
    a, d : float
        Length of the row [m]. The coordinate of a prismatic joint adds to `d`.
    alpha, theta : float
        Angle of the row [rad]. The coordinate of a rotary joint adds to `theta`.
    """

    a: LengthInMetres = 0.0
    alpha: AngleInRadians = 0.0
    d: LengthInMetres = 0.0
    theta: AngleInRadians = 0.0


class RigJoint(JointTable):
    """One of the machine's joints: ``[[rig.joints]]``.

    Attributes
    ----------
    name : str
        Name of the joint, which ends the names of its channels: ``position.elbow``. If a robot's file is given, it is
        the joint's name in that file.
    parent : str or None
        Joint whose body carries this one; ``"base"`` for none; None for the preceding joint in the list.
    place : tuple of float or None
        Origin of the joint's frame in its parent's frame [m]; None if a robot's file states it.
    turned : tuple of float or None
        Roll, pitch and yaw of that frame [rad]; none without the key.
    axis : tuple of float or None
        Axis of the joint in its frame; None if a robot's file states it.
    through : tuple of float or None
        Replaces `place` and `turned`: a point of the joint's axis in the base's frame while every joint is at 0 [m];
        `axis` is then in the base's frame, too.
    dh : DenavitHartenberg or None
        Replaces `place`, `turned` and `axis`: the joint's row of Denavit and Hartenberg.
    body : Body or None
        Body that the joint carries, for all joints or none; None if a robot's file states it. Without both, a body of
        1 kg is assumed.
    rotor_inertia : float
        Inertia of the motor's rotor, at the joint [kg m^2; kg].
    turns : dict[str, float]
        Turns of the joint's motor per turn of each joint, negative for opposite directions: ``{ elbow = 45.0 }``. A
        motor that moves two joints has both. The drive's channel and ``motor_position`` are then those of the motor.
    zero : float
        Position of the joint at which its motor is at 0, for joints that are measured by their motors [rad; m].
    dead_band : float or None
        Speed below which the joint counts as resting [rad/s; m/s]; None for that of ``[processing]``.

    Without a table that takes all joints together, only `dead_band` of these keys is used.
    """

    name: str = Field(pattern=NAME_PATTERN)
    parent: Word | None = None
    place: PositionInMetres | None = None
    turned: tuple[AngleInRadians, AngleInRadians, AngleInRadians] | None = None
    axis: Annotated[tuple[float, float, float] | None, AfterValidator(_unit_vector)] = None
    through: PositionInMetres | None = None
    dh: DenavitHartenberg | None = None
    body: Body | None = None
    rotor_inertia: quantity("<rotor>", ge=0) = 0.0
    turns: dict[str, Annotated[float, Field(ge=-1e5, le=1e5)]] = Field({})
    zero: quantity("<coordinate>") = 0.0
    dead_band: quantity("<velocity>", ge=0) | None = None

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.name

    @property
    def of_a_tree(self) -> tuple[str, ...]:
        """Keys of the table that are meaningful only if all joints are identified at once."""
        others = {*JointTable.model_fields, "name", "dead_band"}
        return tuple(key for key in RigJoint.model_fields if key in self.model_fields_set - others)

    @model_validator(mode="after")
    def _motor_turns_with_it(self) -> RigJoint:
        if self.turns and not self.turns.get(self.name):
            raise ValueError(f"turns: found {self.turns}, expected how often the motor turns with {self.name} itself")
        if self.turns and self.drive is not None and self.drive.gear_ratio != 1.0:
            raise ValueError("found turns and a gear_ratio, expected one of them: turns include the gear ratio")
        return self

    @model_validator(mode="wrap")
    @classmethod
    def _in_its_own_units(cls, table: Any, handler: Any, info: ValidationInfo) -> RigJoint:
        units = info.context or {}
        before, name = dict(units), table.get("name") if isinstance(table, dict) else None
        units.update(units.get("joints", {}).get(name, {}) if isinstance(name, str) else {})
        try:
            return handler(table)
        finally:
            units.clear()
            units.update(before)


class SeveralJoints(StudyTable):
    """The machine, joint by joint: ``[rig]``, with a table ``[[rig.joints]]`` for each.

    Access to an attribute of a single joint raises a StudyError that names the joints.

    Attributes
    ----------
    joints : tuple of RigJoint
        Joints of the machine, each with the keys of ``[[rig.joints]]``.
    instruments : InstrumentsTable
        Sensors that all joints share; ``[rig.joints.instruments]`` of a joint replaces single keys.
    """

    joints: tuple[RigJoint, ...] = Field(min_length=1)
    instruments: InstrumentsTable = InstrumentsTable()

    @model_validator(mode="before")
    @classmethod
    def _each_once(cls, table: Any) -> Any:
        names = joint_names({"rig": table})
        if len(set(names)) < len(names):
            raise ValueError(f"found the joints {', '.join(names)}, expected each name once")
        return table

    @model_validator(mode="after")
    def _slides_alone(self) -> SeveralJoints:
        if len(self.joints) > 1 and any(joint.slider is not None for joint in self.joints):
            raise ValueError(f"found a slider in a machine of {len(self.joints)} joints, expected one joint")
        return self

    @model_validator(mode="after")
    def _turn_with_joints(self) -> SeveralJoints:
        names = [joint.name for joint in self.joints]
        for joint in self.joints:
            unknown = [name for name in joint.turns if name not in names]
            if unknown:
                raise ValueError(f'{joint.name}: turns: found "{unknown[0]}", expected joints: {", ".join(names)}')
        return self

    @model_validator(mode="after")
    def _share_instruments(self) -> SeveralJoints:
        if self.instruments.model_fields_set and len({joint.motion for joint in self.joints}) > 1:
            raise ValueError(
                "[rig.instruments] found joints that turn and joints that slide, whose units differ; expected "
                "[rig.joints.instruments] of each"
            )
        completed = [joint.instruments.completed_by(self.instruments) for joint in self.joints]
        for joint, instruments in zip(self.joints, completed, strict=True):
            try:
                instruments.require_encoder()
            except ValueError as error:
                raise ValueError(f"[[rig.joints]] {joint.name}: {error}") from None
        pairs = zip(self.joints, completed, strict=True)
        joints = tuple(joint.model_copy(update={"instruments": instruments}) for joint, instruments in pairs)
        return self.model_copy(update={"joints": joints})

    @property
    def refusal(self) -> str:
        """Message of a command that supports one joint only."""
        names = ", ".join(joint.name for joint in self.joints)
        return (
            f"study.toml: found {len(self.joints)} joints in [[rig.joints]] ({names}), expected one: without a table "
            "[tree] `identify` takes joints one at a time, and nothing else does; add [tree] with the robot's URDF, "
            "or make a study of one joint, whose [channels] name its columns of the same files"
        )

    def __getattr__(self, name: str) -> Any:
        if name in JointTable.model_fields or name in ("joint", "name"):
            raise StudyError(self.refusal)
        return super().__getattr__(name)


_ONE_TAG = DERIVED_PREFIX + "one"
"""Tag of the schema's variant for a rig with one joint."""

_SEVERAL_TAG = DERIVED_PREFIX + "several"
"""Tag of the schema's variant for a rig with several joints."""


def _unpack_single_joint(rig: OneJoint | SeveralJoints) -> JointTable | SeveralJoints:
    """Return the joint itself if the list has only one."""
    return rig.joints[0] if len(rig.joints) == 1 else rig


RigTable = Annotated[
    Annotated[OneJoint, Tag(_ONE_TAG)] | Annotated[SeveralJoints, Tag(_SEVERAL_TAG)],
    Discriminator(lambda table: _SEVERAL_TAG if isinstance(table, dict) and "joints" in table else _ONE_TAG),
    AfterValidator(_unpack_single_joint),
]
"""``[rig]`` in either form."""


class Participant(StudyTable):
    """A wearer of the machine: ``[participants.NAME]``.

    Attributes
    ----------
    mass : float or None
        Mass of the body [kg].
    height : float or None
        Height of the body [m].
    age : float or None
        Age in years.
    sex : str or None
        ``"female"`` or ``"male"``.
    shank_length : float or None
        Length of the shank from the knee to the heel [m].
    """

    mass: quantity("kg", gt=0) | None = None
    height: quantity("m", gt=0) | None = None
    age: float | None = Field(None, gt=0)
    sex: Literal["female", "male"] | None = None
    shank_length: quantity("m", gt=0) | None = None


DELAYED_CHANNELS = ("torque", "force", "current", "voltage", "duty")
"""Channels of a drive. Their delay against the position can be estimated."""


def _not_zero(scale: float | None) -> float | None:
    if scale == 0.0:
        raise ValueError("found 0, which makes every sample 0, expected the factor of the samples")
    return scale


def _require_column(column: Any) -> None:
    if isinstance(column, bool) or (isinstance(column, int) and column < 0):
        raise ValueError(f"found {column!r}, expected a column's name or its number from 0")


def _split_constant(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of a constant channel with `value`, a number with its unit, split into number and unit."""
    others = sorted(key for key in table if key != "value" and not key.startswith(DERIVED_PREFIX))
    if others or table[DERIVED_PREFIX + "name"] == "time":
        raise ValueError(
            f"found value and {', '.join(others) or 'no times'}, expected value alone, because it applies to every "
            "sample"
        )
    number, _, unit = str(table["value"]).strip().partition(" ")
    try:
        value = float(number)
    except ValueError:
        raise ValueError(f'value: found {table["value"]!r}, expected a number and its unit, such as "60 deg"') from None
    return {**table, "value": value, "unit": unit, "column": str(table["value"])}


class Subtracted(StudyTable):
    """A column that is subtracted from a channel: ``[channels.NAME.minus]``. A text alone is the column.

    Attributes
    ----------
    column : str or int
        Name or number of the column.
    scale : float or None
        The channel's unit per stored count; None for the channel's own scale.
    """

    column: str | int
    scale: Annotated[float | None, AfterValidator(_not_zero)] = None

    @model_validator(mode="before")
    @classmethod
    def _column_alone(cls, table: Any) -> Any:
        table = {"column": table} if isinstance(table, (str, int)) else table
        if isinstance(table, dict) and "column" in table:
            _require_column(table["column"])
        return table


class ChannelSpec(StudyTable):
    """The source and meaning of a channel's numbers: one entry of ``[channels]``.

    The conversion has these steps. Unsigned counts become signed ones, missing marks become NaN, and a rolling count is
    unwrapped. Then value = sign * (scale * stored - scale of `minus` * its stored number) + offset, in `unit`. Finally
    a rolling value is unwrapped, and the value is converted to SI.

    Attributes
    ----------
    name : str
        Name of the channel.
    column : str or int
        Name of the column, without the unit in the header; its number from 0 in a file without a header; or the dotted
        path of nested data: ``entries.position`` is a field of every element of a list, ``data.2`` the third column of
        a matrix, ``data.1.4`` a column of an array of three dimensions. A single number applies to all samples.
    unit : str
        Unit of the value after `scale`.
    sign : int
        -1 reverses the channel.
    offset : float
        Offset that is added last, in `unit`.
    scale : float
        `unit` per stored count.
    value : float or None
        Constant value of the channel [unit], instead of a column, such as the position of a joint that was held.
    minus : Subtracted or None
        Another column that is subtracted, such as that of an opposing cable (``minus = "extensor"``) or of a spring's
        other end.
    interleaved : tuple of int or None
        Place of the channel, from 0, and number of columns of a flat list that holds the columns in turn: ``[2, 7]`` is
        the third of seven.
    stacked : tuple of int or None
        The same for a flat list that holds one column after another.
    wrap_bits : int or None
        Number of bits after which the stored count rolls over.
    wrap : float or None
        Period after which the value rolls over [SI].
    signed_bits : int or None
        Number of bits of a signed count that was stored as an unsigned one.
    sign_bit : int or None
        Bit that states a minus sign, from 0; the bits below it hold the magnitude, as in Feetech servos.
    missing : str, float or None
        ``"NaN"``, or the number that marks a missing sample.
    rate : float or None
        Sampling rate of a file without a column of times: sample n is at n / rate [Hz].
    clip : str
        ``"refuse"``, or ``"accept"`` if the channel may rest at its largest value.
    delay : str, float or None
        Delay of the channel relative to the file's time [s], negative if it is early. Without the key, the delay of the
        drive's channel is estimated and corrected if it is significant; ``"auto"`` corrects it whatever its size, and
        ``"0 s"`` not at all.
    lag : float or None
        Time constant of a first-order filter that the channel has passed [s]; it is corrected.
    si_factor, si_offset : float
        Numbers of the conversion: SI value = value * si_factor + si_offset.
    si_unit : str
        SI unit as plain text.
    """

    name: str = Field(validation_alias=DERIVED_PREFIX + "name")
    column: str | int
    unit: str
    sign: Literal[1, -1] = 1
    offset: float = 0.0
    scale: Annotated[float, AfterValidator(_not_zero)] = 1.0
    value: Annotated[float | None, Field(json_schema_extra={"type": "string"})] = None
    minus: Subtracted | None = None
    interleaved: tuple[int, int] | None = None
    stacked: tuple[int, int] | None = None
    wrap_bits: int | None = Field(None, ge=6, le=64)
    wrap: Annotated[float | None, Field(gt=0, json_schema_extra={"type": "string"})] = None
    signed_bits: int | None = Field(None, ge=2, le=64)
    sign_bit: int | None = Field(None, ge=1, le=62)
    missing: Literal["NaN"] | float | None = None
    rate: quantity("Hz", gt=0) | None = None
    clip: Literal["refuse", "accept"] = "refuse"
    delay: Annotated[Literal["auto"] | float | None, Field(json_schema_extra={"type": "string"})] = None
    lag: quantity("s", gt=0) | None = None
    si_factor: float = Field(validation_alias=DERIVED_PREFIX + "si_factor")
    si_offset: float = Field(validation_alias=DERIVED_PREFIX + "si_offset")
    si_unit: str = Field(validation_alias=DERIVED_PREFIX + "si_unit")

    @field_validator("column", mode="before")
    @classmethod
    def _no_bool(cls, column: Any) -> Any:
        _require_column(column)
        return column

    @field_validator("delay", mode="before")
    @classmethod
    def _a_time_or_auto(cls, delay: Any) -> Any:
        return delay if delay in ("auto", None) else parse_quantity(delay, "s", "")

    @model_validator(mode="after")
    def _place_in_flat_list(self) -> ChannelSpec:
        if self.interleaved is not None and self.stacked is not None:
            raise ValueError("found interleaved and stacked, expected one of them: a list holds its columns in one way")
        place = self.interleaved or self.stacked
        if place is not None and not 0 <= place[0] < place[1]:
            raise ValueError(f"found the place {list(place)}, expected a column from 0 and the number of columns")
        return self

    @model_validator(mode="after")
    def _one_encoding(self) -> ChannelSpec:
        if self.signed_bits is not None and self.sign_bit is not None:
            raise ValueError("found signed_bits and sign_bit, expected one of them: a count has one kind of sign")
        return self

    @model_validator(mode="after")
    def _delay_fits_channel(self) -> ChannelSpec:
        if self.name == "time" and not self.delay is self.lag is None:
            raise ValueError("found a delay of the channel time, expected it at the delayed channel")
        if self.delay == "auto" and self.name.partition(".")[0] not in DELAYED_CHANNELS:
            raise ValueError(
                f'found delay = "auto", which is estimated of {", ".join(DELAYED_CHANNELS)} alone; expected a time'
            )
        return self

    @model_validator(mode="before")
    @classmethod
    def _to_si(cls, table: Any, info: ValidationInfo) -> Any:
        if not isinstance(table, dict):
            raise ValueError(f'found {table!r}, expected a table such as {{ column = "q", unit = "rad" }}')
        name = table[DERIVED_PREFIX + "name"]
        if "rate" in table:
            if name != "time" or "column" in table:
                raise ValueError(
                    "found rate with a column, expected rate alone: it replaces the column and the unit of time"
                )
            table = {"column": 0, "unit": "s", **table}
        if "value" in table:
            table = _split_constant(table)
        expected = channel_unit(name, info.context or {}, table.get("unit"))
        if table.get("unit") in (None, ""):
            such = f'expected one such as "{expected}"' if expected else 'expected one such as "V", or "1" for none'
            raise ValueError(f"no unit found, {such}")
        factor, offset = to_si_factor(table["unit"], expected, "")
        if "wrap" in table:
            if "wrap_bits" in table:
                raise ValueError("found wrap and wrap_bits, expected one of them: the value or the count rolls over")
            table = {**table, "wrap": parse_quantity(table["wrap"], expected or si_text(table["unit"]), "wrap")}
        si = {"si_factor": factor, "si_offset": offset, "si_unit": expected or si_text(table["unit"])}
        return {**table, **{DERIVED_PREFIX + key: value for key, value in si.items()}}


class Optical(StudyTable):
    """The contents of the motion capture's files: ``[optical]``.

    Attributes
    ----------
    time : ChannelSpec
        Channel of the motion capture's own clock. Its offset and drift are estimated from the motion.
    unit : str
        Unit of the coordinates.
    markers : tuple of str
        Names of the markers to read. All but the carriage's are on the moving segment, far apart.
    columns : str
        Name of a coordinate's column, in which ``{marker}`` and ``{axis}`` (x, y or z) are replaced.
    down : tuple of float
        Direction of gravity along the lab's axes, of length 1.
    """

    time: ChannelSpec
    unit: str
    markers: Annotated[tuple[ShownText, ...], AfterValidator(_each_once)]
    columns: str = "{marker}_{axis}"
    down: Annotated[tuple[float, float, float], AfterValidator(_unit_vector)]

    @model_validator(mode="before")
    @classmethod
    def _name_time(cls, table: Any) -> Any:
        if isinstance(table, dict) and isinstance(table.get("time"), dict):
            return {**table, "time": {**table["time"], DERIVED_PREFIX + "name": "time"}}
        return table

    @field_validator("time", mode="before")
    @classmethod
    def _time_is_a_table(cls, time: Any) -> Any:
        if not isinstance(time, dict):
            raise ValueError(f'found {time!r}, expected a table such as {{ column = "time", unit = "s" }}')
        return time

    @field_validator("unit")
    @classmethod
    def _length(cls, unit: str) -> str:
        to_si_factor(unit, "m", "")
        return unit

    @field_validator("columns")
    @classmethod
    def _both_vary(cls, columns: str) -> str:
        if "{marker}" not in columns or "{axis}" not in columns:
            raise ValueError(f'found "{columns}", expected {{marker}} and {{axis}} in it')
        return columns

    @field_validator("down", mode="before")
    @classmethod
    def _along_three_axes(cls, down: Any) -> Any:
        if not isinstance(down, (list, tuple)) or len(down) != 3:
            raise ValueError(f"found {down!r}, expected three numbers such as [0, 0, -1]")
        return down

    @property
    def si_factor(self) -> float:
        """Metres per `unit`."""
        return to_si_factor(self.unit, "m", "")[0]

    def column(self, marker: str, axis: str) -> str:
        """Return the name of the column with one coordinate of a marker; `axis` is ``"x"``, ``"y"`` or ``"z"``."""
        return self.columns.replace("{marker}", marker).replace("{axis}", axis)


class Stream(StudyTable):
    """The files of another instrument: ``[streams.NAME]``.

    Attributes
    ----------
    channels : dict[str, ChannelSpec]
        ``[streams.NAME.channels]``; ``time`` is the instrument's own clock.
    join : bool
        Whether its channels become channels of the recording, on the recording's time. Drive and encoder may then come
        from two loggers. The common part of both clocks is kept, and a faster instrument is averaged over each step.
    offset : str or float
        Delay of its clock in all recordings, if joined [s]. ``"auto"`` estimates it for each recording from the effect
        of the drive on the joint, within a minute, and reports its interval.
    drift : str or float
        Relative rate error of its clock, if joined, such as ``"20e-6"``. ``"auto"`` estimates it from both halves of
        the recording, and uses it if it is significant.
    computed : str
        How its numbers were computed, where no instrument measured them, such as ``"torque by inverse dynamics"``.
    """

    channels: dict[Word, ChannelSpec]
    join: bool = False
    offset: Annotated[Literal["auto"] | float, Field(json_schema_extra={"type": "string"})] = "auto"
    drift: Annotated[Literal["auto"] | float, Field(json_schema_extra={"type": "string"})] = "auto"
    computed: ShownText = ""

    @field_validator("offset", "drift", mode="before")
    @classmethod
    def _given_or_auto(cls, value: Any, info: ValidationInfo) -> Any:
        return value if value == "auto" else parse_quantity(value, {"offset": "s", "drift": "1"}[info.field_name], "")

    @model_validator(mode="before")
    @classmethod
    def _spread_channels(cls, table: Any) -> Any:
        if isinstance(table, dict) and isinstance(table.get("channels"), dict):
            return {**table, "channels": _flat_channels(table["channels"])}
        return table

    @model_validator(mode="after")
    def _has_a_clock(self) -> Stream:
        if "time" not in self.channels:
            raise ValueError("no channel time found, expected one with its column and unit, or its rate")
        if not self.join and {"offset", "drift"} & self.model_fields_set:
            raise ValueError("found offset or drift of a stream that is not joined, expected join = true with them")
        both = {"position", *DELAYED_CHANNELS} & set(self.channels)
        if self.join and not both and "auto" in (self.offset, self.drift):
            raise ValueError(
                'found join = true with neither position nor the drive among its channels: expected offset = "... s" '
                "and drift = 0, which this stream does not identify"
            )
        return self


class Processing(StudyTable):
    """The processing of samples before a regression: ``[processing]``.

    Attributes
    ----------
    lowpass : float or None
        Cut-off of the zero-phase low-pass on both sides of the regression [Hz]; identification requires it.
    order : int
        Order of the Butterworth filter, which runs forwards and backwards.
    sliding_means : tuple of int or None
        Numbers of samples of sliding means, of effort and of position, that replace the low-pass for a joint with
        a carriage. Both means are centred.
    decimate : int
        Factor of decimation after filtering.
    resample : float or None
        Uniform rate for interpolation before filtering [Hz]. Gaps and missing samples of up to half a period of
        `lowpass` are then interpolated. Without it, a clock that jitters is interpolated to its mean rate.
    smooth_stamps : str
        ``"automatic"`` smooths time stamps that jitter if the recorded motion then fits them better, unless `resample`
        is stated; ``"always"`` and ``"never"`` decide it.
    dead_band : float
        Speed below which samples are excluded [rad/s or m/s].
    trim : int
        Number of samples that are excluded at each border, because the filter has not settled there.
    velocity : str
        Source of the velocity: ``"differentiated"`` from the position, or ``"recorded"`` in the channel ``velocity``,
        which is compared with the position first.
    cut : str
        ``"automatic"`` excludes spikes, dropouts, frozen and clipped stretches, gaps and missing samples; ``"none"``
        rejects a recording that has them.
    cut_share : float
        Largest share of a recording's samples that may be excluded automatically, in [0, 1).
    """

    lowpass: quantity("Hz", gt=0) | None = None
    order: int = Field(4, ge=1, le=12)
    sliding_means: tuple[int, int] | None = None
    decimate: int = Field(1, ge=1)
    resample: quantity("Hz", gt=0) | None = None
    smooth_stamps: Literal["automatic", "always", "never"] = "automatic"
    dead_band: quantity("<velocity>", ge=0) = 0.0
    trim: int = Field(0, ge=0)
    velocity: Literal["differentiated", "recorded"] = "differentiated"
    cut: Literal["automatic", "none"] = "automatic"
    cut_share: float = Field(DEFAULT_CUT_SHARE, ge=0, lt=1)

    @field_validator("sliding_means")
    @classmethod
    def _counts_samples(cls, means: tuple[int, int] | None) -> tuple[int, int] | None:
        if means is not None and min(means) < 1:
            raise ValueError(f"found {list(means)}, expected two numbers of samples, such as [100, 40]")
        return means

    @property
    def stamp_smoothing(self) -> str:
        """What is done to time stamps; a stated rate leaves them as they were recorded, unless the study decides it."""
        return "never" if self.smooth_stamps == "automatic" and self.resample is not None else self.smooth_stamps


class Model(StudyTable):
    """The model that is identified: ``[model]``.

    Attributes
    ----------
    families : tuple of str
        Friction models that are compared.
    gravity : str
        Gravity term: ``"none"``, ``"sine"``, or ``"sine+cosine"`` if the joint does not hang at the encoder's zero. By
        default ``"sine"``, and ``"none"`` for a prismatic joint.
    known : Mapping[str, float]
        Parameters that are held at a known value: ``known = { inertia = "0.02 kg*m^2" }``.
    purpose : str
        Purpose of the selected model: ``"torque"`` predicts the effort of a motion, ``"simulation"`` the motion of a
        command.
    confidence : float
        Confidence level of the intervals, in (0, 1).
    posterior : bool
        Whether a posterior is computed in addition to the intervals.
    min_improvement : float
        Least relative reduction of the cross-validated error by a richer model, on stretches of the fitted recordings,
        in [0, 1).
    """

    families: Annotated[tuple[Literal[tuple(FAMILIES)], ...], AfterValidator(_each_once)] = DEFAULT_FAMILIES
    gravity: Literal["none", "sine", "sine+cosine"]
    known: dict[str, float] = Field({})
    purpose: Literal["torque", "simulation"] = "torque"
    confidence: float = Field(0.95, gt=0, lt=1)
    posterior: bool = False
    min_improvement: float = Field(0.05, ge=0, lt=1)

    @model_validator(mode="before")
    @classmethod
    def _default_gravity(cls, table: Any, info: ValidationInfo) -> Any:
        if isinstance(table, dict) and "gravity" not in table:
            return {**table, "gravity": "none" if (info.context or {}).get("motion") == "prismatic" else "sine"}
        return table

    @field_validator("known", mode="before")
    @classmethod
    def _known(cls, known: Any, info: ValidationInfo) -> Any:
        if not isinstance(known, dict):
            return known
        units = info.context or {}
        values = {name: parse_quantity(text, parameter_units(name, units), name) for name, text in known.items()}
        for name, value in values.items():
            kind, found = name.split("_")[0], f'{name}: found "{known[name]}", expected'
            if value <= 0.0 and kind in ("inertia", "mass"):
                raise ValueError(f"{found} more than 0: every body has inertia")
            if name in SYMBOLS_BY_NAME and value < SYMBOLS_BY_NAME[name].lower:
                raise ValueError(f"{found} {SYMBOLS_BY_NAME[name].lower:g} or more: friction takes energy")
            if abs(value) > MAX_KNOWN_MAGNITUDE:
                raise ValueError(f"{found} at most {MAX_KNOWN_MAGNITUDE:g} in SI: no such machine has more")
        return values

    @model_validator(mode="after")
    def _no_weight_along_a_slide(self, info: ValidationInfo) -> Model:
        if (info.context or {}).get("motion") == "prismatic" and self.gravity != "none":
            raise ValueError(f'found gravity = "{self.gravity}" with motion = "prismatic", expected "none"')
        return self


class PayloadSpec(StudyTable):
    """A mass on the moving segment: ``[recordings.payload]``. An empty table states an unknown payload.

    Attributes
    ----------
    mass : float or None
        Mass of the payload [kg]; without it the mass is estimated, and the recording is used for nothing else.
    distance : float
        Distance of its centre of mass from the joint's axis [m].
    link : str or None
        In a robot of several joints, the link that carries it; None for the last one.
    centre : tuple of float or None
        In a robot of several joints, its centre of mass in the frame of that link [m]; None if unknown.
    """

    mass: quantity("kg", gt=0) | None = None
    distance: quantity("m", ge=0) = 0.0
    link: ShownText | None = None
    centre: PositionInMetres | None = None


class RecordingEntry(StudyTable):
    """One recording, in the order of reports: ``[[recordings]]``.

    Attributes
    ----------
    name : str
        Name of the recording, which is part of the ids of its figures.
    file : str or None
        Path of the file, from the study's folder. A maximal contraction (protocol ``"mvc"``) may have one of `streams`
        instead.
    files : str or None
        Replaces `file`: a pattern such as ``"recordings/P1_*.csv"``. Each match is the recording ``<name>.<stem>``.
    protocol : str or None
        Name of the protocol, such as ``"swept_sine"``. Some have a meaning: ``"locked_spring"`` for a spring with one
        locked end, ``"reversals"`` and ``"free_carriage"`` for a joint with a carriage, ``"mvc"`` for a maximal
        contraction, ``"empty_swing"`` and ``"loaded_swing"`` for the swings of an exoskeleton.
    use : str
        ``"fit"``, or ``"validate"`` for a held-out recording, which is only predicted.
    window : tuple of float or None
        Start and end of the used samples, start <= time < end on the file's own clock [s].
    exclude : tuple of tuple of float
        Starts and ends of the excluded samples, start <= time < end on the file's own clock [s].
    participant : str or None
        Participant of the trial, one of ``[participants]``.
    condition : str or None
        Condition of the trial, such as a controller.
    repetition : int or None
        Number of the repetition, from 1, by which torque steps are cross-validated. By default recordings of a
        participant at the same angle are counted.
    period : int or None
        Period of the session, from 1. ``assess`` then removes its effect from the change between conditions.
    amplitude : float or None
        Signed distance that each movement was to cover [rad or m], if no channel records it. Of an isolated muscle, the
        largest displacement of its end.
    payload : PayloadSpec or None
        Mass carried during the trial; without its `mass` it is unknown and estimated.
    optical : str or None
        Path of the motion capture's file of the same trial, from the study's folder; it requires ``[optical]``.
    streams : dict[str, str]
        Paths of other instruments' files of the same trial, by the name of their ``[streams.NAME]``.
    offsets : dict[str, float]
        Offsets of those instruments' clocks in this trial [s], for streams that are joined.
    slider : float or None
        Distance from the axis at which the carriage was clamped, measured with a ruler [m].
    start : str
        Initial state of a simulation: ``"measured"`` (position and velocity of the first samples) or ``"rest"``.
    processing : Processing or None
        Keys that differ from ``[processing]`` in this recording.
    channels : dict[str, ChannelSpec]
        Keys and channels that differ from ``[channels]`` in this recording, or are added.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    file: RelativePath | None = None
    files: RelativePath | None = None
    protocol: Word | None = None
    use: Literal["fit", "validate"] = "fit"
    window: tuple[quantity("s"), quantity("s")] | None = None
    exclude: tuple[tuple[quantity("s"), quantity("s")], ...] = ()
    participant: Word | None = None
    condition: ShownText | None = None
    repetition: int | None = Field(None, ge=1)
    period: int | None = Field(None, ge=1)
    amplitude: quantity("<coordinate>") | None = None
    payload: PayloadSpec | None = None
    optical: RelativePath | None = None
    streams: dict[Word, RelativePath] = Field({})
    offsets: dict[Word, quantity("s")] = Field({})
    slider: quantity("m", ge=0) | None = None
    start: Literal["measured", "rest"] = "measured"
    processing: Processing | None = None
    channels: dict[Word, ChannelSpec] = Field({})

    @model_validator(mode="after")
    def _one_source(self) -> RecordingEntry:
        is_emg_alone = self.protocol == MAXIMAL_PROTOCOL and len(self.streams) == 1
        nowhere = self.file is None and self.files is None
        if (self.file is None) == (self.files is None) and not (nowhere and is_emg_alone):
            raise ValueError("expected one of file and files, found " + ("both" if self.file else "neither"))
        if self.files is not None and (self.optical is not None or self.streams):
            what = f'optical = "{self.optical}"' if self.optical is not None else "streams"
            raise ValueError(
                f'found {what} with files = "{self.files}", expected file: state one file for each recording'
            )
        spans = [("window", self.window)] if self.window is not None else []
        for key, (start, stop) in [*spans, *(("exclude", span) for span in self.exclude)]:
            if start >= stop:
                raise ValueError(f"{key}: found {start:g} s to {stop:g} s, expected start before end")
        return self


class AssumedDefault(StudyTable):
    """One ``[[assumed]]``: a default that was taken because no file states it. Removing it confirms the default.

    Attributes
    ----------
    key : str
        Key of the question, as ``init --answer`` takes it.
    taken : str
        Default that was taken.
    question : str
        The question.
    scale : bool
        Whether every number of the result depends on it.
    """

    key: Word
    taken: ShownText
    question: str = ""
    scale: bool = False


class StudyFile(StudyTable):
    """The whole of study.toml, in SI.

    Attributes
    ----------
    name : str
        First part of every figure's id.
    citation : str
        Source to cite for the recordings; the report prints it.
    notes : tuple of str
        Remarks that the report repeats.
    assumed : tuple of AssumedDefault
        Defaults that nobody confirmed; every answer repeats them.
    simulated : bool, optional
        Whether the recordings were simulated; omitted where that is not known.
    digitised : bool
        Whether the recordings were read off published figures.
    worn : bool
        Whether somebody wears the machine: parameters are then those of machine and limb together.
    rig : OneJoint or SeveralJoints
        The machine: a joint, or a list of joints.
    participants : dict[str, Participant]
        Wearers of the machine, by name.
    channels : dict[str, ChannelSpec]
        Channels of the recordings, by name: the column of each, and its unit. ``time`` is required. A dot makes a
        group: ``emg.biceps``.
    optical : Optical or None
        Contents of a motion capture's files.
    streams : dict[str, Stream]
        Other instruments with files of their own, by name.
    processing : Processing
        Processing of samples before a regression.
    model : Model
        Model that is identified.
    recordings : tuple of RecordingEntry
        Recordings, in the order of reports.
    session : SessionTable or None
        Live session that is planned.

    `study_file_model` adds a field for each table that requests a procedure, which is None if the table is absent.
    """

    name: str = Field(pattern=NAME_PATTERN)
    citation: str = ""
    notes: tuple[str, ...] = ()
    assumed: tuple[AssumedDefault, ...] = ()
    simulated: bool | None = None
    digitised: bool = False
    worn: bool = False
    rig: RigTable
    participants: dict[Word, Participant] = Field({})
    channels: dict[Word, ChannelSpec]
    optical: Optical | None = None
    streams: dict[Word, Stream] = Field({})
    processing: Processing = Processing()
    model: Model
    recordings: tuple[RecordingEntry, ...] = ()
    session: SessionTable | None = None

    @model_validator(mode="before")
    @classmethod
    def _spread_channels(cls, raw: Any) -> Any:
        """Flatten ``emg.biceps`` and complete each recording's channels by the defaults they override."""
        if not isinstance(raw, dict):
            return raw
        raw = {"model": {}, **raw}
        if isinstance(raw.get("channels"), dict):
            raw["channels"] = _without_single_joint(_flat_channels(raw["channels"]), joint_names(raw))
        entries = raw.get("recordings")
        if isinstance(entries, list) and isinstance(raw.get("channels"), dict):
            raw["recordings"] = [_complete_entry(entry, raw["channels"], joint_names(raw)) for entry in entries]
        common = raw.get("processing", {})
        if isinstance(raw.get("recordings"), list) and isinstance(common, dict):
            raw["recordings"] = [
                {**e, "processing": {**common, **e["processing"]}}
                if isinstance(e, dict) and isinstance(e.get("processing"), dict)
                else e
                for e in raw["recordings"]
            ]
        return raw

    @model_validator(mode="after")
    def _references_exist(self) -> StudyFile:
        names: set[str] = set()
        for entry in self.recordings:
            if entry.participant is not None and entry.participant not in self.participants:
                found = ", ".join(self.participants) or "none"
                raise ValueError(
                    f'[[recordings]] {entry.name}: found the participant "{entry.participant}", '
                    f"expected one of [participants]: {found}"
                )
            if entry.name in names:
                raise ValueError(f'[[recordings]] the name "{entry.name}" is given twice, expected each once')
            names.add(entry.name)
            if "time" not in self.channels_of(entry):
                raise ValueError("[channels] no channel time found, expected one with its column and unit")
            channels = set(self.channels_of(entry))
            channels |= {c for stream in entry.streams for c in self.joined_channels(stream)}
            speeds = {"velocity", *(f"velocity.{joint.joint}" for joint in self.rig.joints)}
            if (entry.processing or self.processing).velocity == "recorded" and not speeds & channels:
                raise ValueError(
                    f'[[recordings]] {entry.name}: found [processing] velocity = "recorded" and no channel velocity, '
                    "expected one with its column and unit"
                )
            for stream in entry.streams:
                if stream not in self.streams:
                    raise ValueError(
                        f'[[recordings]] {entry.name}: found the stream "{stream}", expected one of [streams]: '
                        f"{', '.join(self.streams) or 'none'}"
                    )
            for stream in entry.offsets:
                if stream not in entry.streams or not self.streams[stream].join:
                    raise ValueError(
                        f"[[recordings]] {entry.name}: found an offset of {stream}, expected one of its streams with "
                        "join = true"
                    )
        return self

    @model_validator(mode="after")
    def _channels_name_their_joints(self) -> StudyFile:
        names = [joint.joint for joint in self.rig.joints]
        everywhere = {**self.channels, **{n: c for entry in self.recordings for n, c in entry.channels.items()}}
        for name in everywhere if len(names) > 1 else ():
            if name in JOINT_CHANNELS:
                wanted = ", ".join(f"{name}.{joint}" for joint in names)
                raise ValueError(f"[channels] {name}: found no joint's name in it, expected one of {wanted}")
            head, _, last = name.rpartition(".")
            if head in JOINT_CHANNELS and last not in names:
                raise ValueError(f'[channels] {name}: found the joint "{last}", expected one of {", ".join(names)}')
        return self

    @model_validator(mode="after")
    def _tables_fit_together(self) -> StudyFile:
        alone = [name for name, table in self.procedures.items() if table.alone]
        if len(alone) > 1:
            raise ValueError(f"found the tables {', '.join(alone)}, expected one of them: each needs its own study")
        if any(joint.drive is None for joint in self.rig.joints) and not self.procedures:
            raise ValueError("[rig.drive] no such table found, expected one that says how the effort is known")
        for table in self.procedures.values():
            table.require_in(self)
        if self.identifies_each_joint:
            self._require_known_of_one_joint()
        if not any(table.several for table in self.procedures.values()):
            for joint in self.rig.joints:
                if isinstance(joint, RigJoint) and joint.of_a_tree:
                    raise ValueError(
                        f"[[rig.joints]] {joint.name}: found {joint.of_a_tree[0]}, which is used only where all joints "
                        "are identified at once; expected a table [tree]"
                    )
        open_clocks = [n for n, s in self.streams.items() if s.join and "auto" in (s.offset, s.drift)]
        if open_clocks and (alone or self.rail is not None or any(joint.drive is None for joint in self.rig.joints)):
            raise ValueError(
                f'[streams.{open_clocks[0]}] found join = true without offset = "... s" and drift = 0, expected both: '
                "only a study that identifies one joint with friction estimates them"
            )
        return self

    def _require_known_of_one_joint(self) -> None:
        """Refuse what holds for one joint alone where each of several is identified on its own."""
        joints = self.rig.joints
        if self.model.known:
            raise ValueError(
                f"[model] known: found values with {len(joints)} joints in [[rig.joints]], expected none: a "
                "known value is that of one joint; make a study of this joint alone"
            )
        unlike = len({joint.motion for joint in joints}) > 1
        if unlike and self.processing.dead_band and any(joint.dead_band is None for joint in joints):
            raise ValueError(
                "[processing] dead_band: found one for joints that turn and joints that slide, expected dead_band of "
                "each in [[rig.joints]]"
            )

    @model_validator(mode="after")
    def _slider_is_located(self) -> StudyFile:
        rail = self.rail
        marker = rail.marker if rail is not None else None
        if self.optical is not None and marker is not None and marker not in self.optical.markers:
            raise ValueError(
                f'[rig.slider] marker: found "{marker}", expected one of [optical] markers: '
                f"{', '.join(self.optical.markers)}"
            )
        for entry in self.recordings:
            where = f"[[recordings]] {entry.name}"
            if entry.optical is not None and self.optical is None:
                raise ValueError(f"{where}: found optical, expected a table [optical] that says what its file holds")
            if entry.slider is not None and rail is None:
                raise ValueError(f"{where}: found slider, expected a table [rig.slider] with the rail's ends")
            if entry.slider is not None and not rail.low <= entry.slider <= rail.high:
                raise ValueError(
                    f"{where}: found slider = {entry.slider:g} m, expected {rail.low:g} m to {rail.high:g} m as "
                    "[rig.slider] says"
                )
            if entry.optical is not None and rail is not None and marker is None:
                raise ValueError(f"{where}: found optical, expected [rig.slider] marker: which one is on the carriage")
        return self

    @property
    def rail(self) -> Slider | None:
        """The rail of the carriage; None if the machine has none."""
        return next((joint.slider for joint in self.rig.joints if joint.slider is not None), None)

    @property
    def identifies_each_joint(self) -> bool:
        """Whether a machine has several driven joints and no table that takes them together, or runs alone.

        Each joint is then identified on its own, as in a study of that joint.
        """
        several = len(self.rig.joints) > 1 and all(joint.drive is not None for joint in self.rig.joints)
        return several and not any(table.alone or table.several for table in self.procedures.values())

    @property
    def procedures(self) -> dict[str, ProcedureTable]:
        """The tables that request a procedure, by their names."""
        found = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: table for name, table in found.items() if isinstance(table, ProcedureTable)}

    def find_table(self, kind: type[Table]) -> Table | None:
        """Return the table of a class that asks for a procedure; None where study.toml has none."""
        return next((table for table in self.procedures.values() if isinstance(table, kind)), None)

    def table(self, kind: type[Table]) -> Table:
        """Return the table of a class that asks for a procedure; IdentificationError where study.toml has none."""
        found = self.find_table(kind)
        if found is None:
            raise IdentificationError(f"study.toml: found no table [{kind.table_name()}], expected one")
        return found

    def joined_channels(self, stream: str) -> dict[str, ChannelSpec]:
        """Return the channels that a joined stream adds to a recording."""
        table = self.streams.get(stream)
        return {n: c for n, c in table.channels.items() if n != "time"} if table is not None and table.join else {}

    def entry_of(self, recording: str) -> RecordingEntry | None:
        """Return the entry of a recording by its name; None if study.toml does not name it, as one held in memory."""
        named = {entry.name: entry for entry in self.recordings}
        begun = [name for name in named if recording == name or recording.startswith(f"{name}.")]
        return named[max(begun, key=len)] if begun else None

    def processing_of(self, recording: str) -> Processing:
        """Return the processing of a recording's samples, by its name."""
        entry = self.entry_of(recording)
        return self.processing if entry is None or entry.processing is None else entry.processing

    def channels_of(self, entry: RecordingEntry) -> dict[str, ChannelSpec]:
        """Return all channels of a recording's own file: the defaults, replaced by the recording's own ones."""
        return {**self.channels, **entry.channels}


def study_file_model(tables: Mapping[str, type[ProcedureTable]]) -> type[StudyFile]:
    """Return `StudyFile` with a field for each table that may request a procedure, by the table's name."""
    if not tables:
        return StudyFile
    fields: dict[str, Any] = {name: (table | None, None) for name, table in tables.items()}
    return create_model("StudyFile", __base__=StudyFile, **fields)


UNITS_BY_PART = {
    "acceleration": "m/s^2", "angular_velocity": "rad/s", "magnetic_field": "T", "orientation": "1", "angle": "rad",
    "moment": "N*m", "length": "m", "lengthening": "m/s", "moment_arm": "m",
}  # fmt: skip
"""SI unit of a channel by the first or the last but one part of its dotted name."""

CHANNEL_UNITS = {
    "time": "s", "position": "<coordinate>", "reference": "<reference>", "velocity": "<velocity>",
    "acceleration": "<acceleration>", "current": "A", "voltage": "V", "duty": "1", "supply": "V", "torque": "N*m",
    "force": "N", "enabled": "1", "temperature": "K", "motor_position": "<motor>",
    "target": "<coordinate>", "interaction": "<effort>", "desired_current": "A", "desired_torque": "<effort>",
}  # fmt: skip
"""SI unit of a channel by its name; a unit in <> is looked up among the rig's units."""

JOINT_CHANNELS = frozenset(
    ("position", "reference", "velocity", "acceleration", "current", "voltage", "duty", "supply", "torque", "force",
     "enabled", "temperature", "motor_position", "target", "interaction", "desired_current", "desired_torque")
)  # fmt: skip
"""Channels that belong to a joint. If a machine has several joints, these names end in the joint's name."""


def channel_unit(name: str, units: Mapping[str, Any], given: str | None = None) -> str | None:
    """Return the SI unit that a channel must have, by its name; None if any unit is meaningful."""
    head, _, joint = name.rpartition(".")
    own = units.get("joints", {}).get(joint)
    if own is not None and (head in JOINT_CHANNELS or head == own["injected"]):
        return channel_unit(head, own, given)
    expected = CHANNEL_UNITS.get(name)
    parts = name.split(".")
    if parts[0] == "moment" and given in ("MVC", "%MVC"):
        return "MVC"
    if expected is None and parts[0] == "emg" and len(parts) > 1:
        expected = "1" if given in ("1", "%") else "V"
    if expected is None and len(parts) > 1:
        expected = next((UNITS_BY_PART[part] for part in (parts[-2], parts[0]) if part in UNITS_BY_PART), None)
    if expected is None and name == units.get("injected"):
        expected = "<injected>"
    return units.get(expected, expected) if expected else None


def parameter_units(name: str, units: Mapping[str, str | None]) -> str | tuple[str, ...] | None:
    """Return the SI unit that a known parameter must have, or several; None where its name says nothing."""
    effort, coordinate = units["<scaled_effort>"], units["<coordinate>"]
    if effort is None or coordinate is None:
        return None
    per_acceleration = f"{effort}*s^2/{coordinate}"
    kind = name.split("_")[0]
    if kind in ("inertia", "mass"):
        return {"N*m": ("kg*m^2", per_acceleration), "N": ("kg", per_acceleration)}.get(effort, (per_acceleration,))
    if name in SYMBOLS_BY_NAME:
        return SYMBOLS_BY_NAME[name].unit("prismatic" if coordinate == "m" else "rotary", effort)
    return None


def joint_names(raw: Mapping[str, Any]) -> list[str]:
    """Return the names in ``[[rig.joints]]`` of a parsed study.toml; empty in the other form of ``[rig]``."""
    rig = raw.get("rig") if isinstance(raw.get("rig"), dict) else {}
    tables = rig.get("joints") if isinstance(rig.get("joints"), list) else []
    return [t["name"] for t in tables if isinstance(t, dict) and isinstance(t.get("name"), str)]


def rig_units(raw: Mapping[str, Any]) -> dict[str, Any]:
    """Return the SI units that follow from a joint's motion and drive, from a parsed study.toml.

    With ``[[rig.joints]]`` the units of each joint are under ``"joints"``, by its name; the others are those that all
    joints share.
    """
    rig = raw.get("rig") if isinstance(raw.get("rig"), dict) else {}
    channels = raw.get("channels") if isinstance(raw.get("channels"), dict) else {}
    streams = raw.get("streams") if isinstance(raw.get("streams"), dict) else {}
    for table in streams.values():
        if isinstance(table, dict) and table.get("join") is True and isinstance(table.get("channels"), dict):
            channels = {**table["channels"], **channels}
    names = joint_names(raw)
    if not names:
        return _joint_units(rig, set(channels))
    tables = {t["name"]: t for t in rig["joints"] if isinstance(t, dict) and t.get("name") in names}
    flat = set(_flat_channels(channels))
    units = {}
    for name, table in tables.items():
        own = flat if len(names) == 1 else {n for n in flat if n.endswith(f".{name}")}
        units[name] = _joint_units(table, {n.removesuffix(f".{name}") for n in own})
    # A setting for all joints, such as a dead band, has a unit only if all joints share it.
    shared = units[names[0]]
    for other in list(units.values())[1:]:
        shared = {key: value if other[key] == value else None for key, value in shared.items()}
    return {**shared, "joints": units}


def _joint_units(rig: Mapping[str, Any], channels: Collection[str]) -> dict[str, str | None]:
    drive = rig.get("drive") if isinstance(rig.get("drive"), dict) else {}
    loop = rig.get("loop") if isinstance(rig.get("loop"), dict) else {}
    motion, kind = (x if isinstance(x, str) else None for x in (rig.get("motion"), drive.get("kind")))
    # Without a valid motion or kind no unit is expected, so that only the true cause is reported.
    coordinate, effort = {"rotary": ("rad", "N*m"), "prismatic": ("m", "N")}.get(motion, (None, None))
    electrical = {"torque": effort, "current": "A", "voltage": "V"}.get(kind)
    duty = kind == "voltage" and "duty" in channels and "voltage" not in channels
    per = {"current": "A", "voltage": "A" if "resistance" in drive else "V"}.get(kind)
    known = kind == "torque" or "torque_constant" in drive or "force_constant" in drive
    return {
        "motion": motion,
        "injected": loop.get("injected"),
        "<coordinate>": coordinate,
        "<motor>": "rad" if rig.get("turns") else coordinate,
        "<rotor>": {"rad": "kg*m^2", "m": "kg"}.get(coordinate),
        "<reference>": coordinate and (f"{coordinate}/s" if loop.get("kind") == "velocity_pi" else coordinate),
        "<velocity>": coordinate and f"{coordinate}/s",
        "<acceleration>": coordinate and f"{coordinate}/s^2",
        "<effort>": effort,
        "<stiffness>": {"rad": "N*m/rad", "m": "N/m"}.get(coordinate),
        "<scaled_effort>": effort if known else electrical,
        "<constant>": effort and per and f"{effort}/{per}",
        "<command>": "1" if duty else electrical,
        "<injected>": electrical,
    }


def parse_study_file(
    path: Path, model: Callable[[Collection[str] | None], type[StudyFile]] = lambda names: StudyFile
) -> StudyFile:
    """Read and check a study.toml.

    `model` returns a model with the procedures' tables among some names: those in the file, since importing all tables
    takes longer than reading one; or with None, every table.
    """
    try:
        text = read_given(path, MAX_FILE_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        raise StudyError(f"{path}: no such file; a study is a folder with a study.toml in it") from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: not readable: {error}") from error
    raw = parse_toml(text, str(path))
    try:
        return model(raw).model_validate(raw, context=rig_units(raw))
    except ValidationError as error:
        raise StudyError(explain_errors(error, path, text, model(None))) from None
    except StudyError:
        raise
    except (TypeError, ValueError, KeyError, AttributeError, ArithmeticError, RecursionError) as error:
        # A value of the wrong type may break a validator that runs before the value's own check.
        raise StudyError(f"{path}: not understood: {type(error).__name__}: {error}") from error


def json_schema(model: type[StudyFile] = StudyFile) -> dict[str, Any]:
    """Return the JSON Schema of study.toml, for editors that complete and check keys."""
    schema = model.model_json_schema()
    channel = schema["$defs"]["ChannelSpec"]
    channel["properties"] = {key: value for key, value in channel["properties"].items() if key[0] != DERIVED_PREFIX}
    channel["required"] = ["column", "unit"]
    one = {"$ref": "#/$defs/ChannelSpec"}
    # emg.biceps is a table in a table; a recording's own channel may state only the keys that differ.
    schema["properties"]["channels"]["additionalProperties"] = {
        "anyOf": [one, {"type": "object", "additionalProperties": one}]
    }
    schema["$defs"]["RecordingEntry"]["properties"]["channels"] = {"type": "object"}
    schema["$defs"]["Model"].pop("required", None)
    schema["required"] = ["name", "rig", "channels"]
    return schema


def _flat_channels(tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, table in tables.items():
        name = f"{prefix}{key}"
        group = isinstance(table, dict) and table and all(isinstance(v, dict) for v in table.values())
        if group:
            flat.update(_flat_channels(table, f"{name}."))
        else:
            flat[name] = {**table, DERIVED_PREFIX + "name": name} if isinstance(table, dict) else table
    return flat


def _without_single_joint(channels: dict[str, Any], joints: list[str]) -> dict[str, Any]:
    """Remove the name of a machine's only joint from its channels' names."""
    if len(joints) != 1:
        return channels

    def plain(name: str) -> str:
        head = name.removesuffix(f".{joints[0]}")
        return head if head in JOINT_CHANNELS else name

    return {
        plain(name): {**table, DERIVED_PREFIX + "name": plain(name)} if isinstance(table, dict) else table
        for name, table in channels.items()
    }


def _complete_entry(entry: Any, defaults: Mapping[str, Any], joints: list[str]) -> Any:
    if not isinstance(entry, dict) or not isinstance(entry.get("channels"), dict):
        return entry
    own = _without_single_joint(_flat_channels(entry["channels"]), joints)
    merged = {
        name: {**defaults[name], **table}
        if isinstance(table, dict) and _can_complete(defaults.get(name), table)
        else table
        for name, table in own.items()
    }
    return {**entry, "channels": merged}


def _can_complete(default: Any, own: Mapping[str, Any]) -> bool:
    """Whether the study's channel can complete a recording's own one: both are columns, or both constants."""
    return isinstance(default, dict) and ("value" in default) == ("value" in own)
