"""What study.toml may say: its keys, their units, and what each leaves out.

Quantities are texts with a unit; they become SI numbers here. ``docs/study-file.md`` explains every key.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

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

from .._errors import StudyError
from .._given import read_given
from ..models.joint import DEFAULT_FAMILIES, FAMILIES, SYMBOLS_BY_NAME
from ..units import parse_quantity, si_text, to_si_factor
from .study_fields import DERIVED, NAME, Place, ProcedureTable, Said, StudyTable, Word, quantity
from .toml_place import explain

MOST_BYTES = 3_000_000
"""Of a study.toml; Python's reader takes a second for each million [B]."""

# Gains that a kind of loop needs, and those it may have.
_GAINS = {
    "p": (("kp",), ()),
    "pi": (("kp", "ki"), ()),
    "pd": (("kp", "kd"), ()),
    "cascade": (("kp", "kv"), ("ki",)),
    "velocity_pi": (("kp", "ki"), ()),
}


MOST_KNOWN = 1e5
"""Largest magnitude of a known parameter [SI]; that of an industrial robot's first axis is below."""


class Drive(StudyTable):
    """How the effort is known: ``[rig.drive]``.

    Attributes
    ----------
    kind : str
        ``"torque"`` (a sensor), ``"current"`` or ``"voltage"``.
    torque_constant, force_constant : float or None
        Effort per ampere [N*m/A, N/A], or per volt for a voltage drive without a resistance [N*m/V, N/V].
        None: results stay per ampere or per volt.
    gear_ratio : float
        Motor turns per turn of the joint; the constant times it is the effort at the joint.
    resistance : float or None
        Of the winding [ohm]; with it a voltage drive's back-EMF is known.
    supply : float or None
        Voltage at full duty [V], where the drive is known by its duty.
    limit : float or None
        Largest magnitude of the command, in the channel's SI unit.
    """

    kind: Literal["torque", "current", "voltage"]
    torque_constant: quantity("<constant>", gt=0, le=1e4) | None = None
    force_constant: quantity("<constant>", gt=0, le=1e6) | None = None
    gear_ratio: float = Field(1.0, ge=1e-5, le=1e5)
    resistance: quantity("ohm", gt=0, le=1e5) | None = None
    supply: quantity("V", gt=0, le=1e4) | None = None
    limit: quantity("<command>", gt=0) | None = None

    @property
    def constant(self) -> float | None:
        """`torque_constant` of a rotary rig, `force_constant` of a prismatic one."""
        return self.torque_constant if self.torque_constant is not None else self.force_constant

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Drive:
        motion = (info.context or {}).get("motion")
        if self.torque_constant is not None and motion == "prismatic":
            raise ValueError('found torque_constant with motion = "prismatic", expected force_constant')
        if self.force_constant is not None and motion == "rotary":
            raise ValueError('found force_constant with motion = "rotary", expected torque_constant')
        if self.kind == "torque" and self.constant is not None:
            raise ValueError('found a constant with kind = "torque": a measured effort needs none')
        if self.resistance is not None and (self.kind != "voltage" or self.constant is None):
            raise ValueError('found resistance, which is used only with kind = "voltage" and a known constant')
        return self


class Loop(StudyTable):
    """The machine's own controller: ``[rig.loop]``. Gains are plain numbers in SI, in the drive's command unit.

    Attributes
    ----------
    kind : str
        ``"p"``, ``"pi"``, ``"pd"``, ``"cascade"`` (command = kv*(kp*(reference - position) - velocity)) or
        ``"velocity_pi"``, whose reference is a velocity.
    kp, ki, kd, kv : float or None
        Gains.
    limit : float or None
        Largest magnitude of the command, in its SI unit.
    injected : str or None
        Channel that is added to the command after the limit.
    velocity_span : int
        Over how many samples the machine differences position to get its velocity; 0 where it is not known.
    period : float or None
        Of the controller [s]; None: that of the recording.
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
        needed, optional = _GAINS[self.kind]
        missing = [gain for gain in needed if getattr(self, gain) is None]
        used = {*needed, *optional}
        unused = [gain for gain in ("kp", "ki", "kd", "kv") if gain not in used and getattr(self, gain) is not None]
        if missing or unused:
            found = f"missing {', '.join(missing)}" if missing else f"unused {', '.join(unused)}"
            raise ValueError(f'kind = "{self.kind}" expects the gains {", ".join(needed)}: {found}')
        return self


InMetres = tuple[quantity("m"), quantity("m"), quantity("m")]
"""Three coordinates."""


class JointLimits(StudyTable):
    """What the joint may not pass: ``[rig.limits]``, each [rad] or [m], [rad/s] or [m/s], [N*m] or [N]."""

    position_min: quantity("<coordinate>") | None = None
    position_max: quantity("<coordinate>") | None = None
    velocity: quantity("<velocity>", gt=0) | None = None
    effort: quantity("<effort>", gt=0) | None = None

    @model_validator(mode="after")
    def _ordered(self) -> JointLimits:
        low, high = self.position_min, self.position_max
        if low is not None and high is not None and low >= high:
            raise ValueError(f"found position_min = {low:g} not below position_max = {high:g}")
        return self


class Slider(StudyTable):
    """A carriage that moves freely on a rail along the moving segment: ``[rig.slider]``.

    Attributes
    ----------
    low, high : float
        The rail's ends, as distances from the joint's axis along the segment [m].
    marker : str or None
        Marker on the carriage, one of ``[optical]``'s; None where every position is known by a ruler.
    mass : float or None
        Of the carriage, weighed [kg]; it lets friction while the motor drives be told from friction while the load
        does.
    """

    low: quantity("m", ge=0)
    high: quantity("m", gt=0)
    marker: Said | None = None
    mass: quantity("kg", gt=0) | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Slider:
        if self.low >= self.high:
            raise ValueError(f"found low = {self.low:g} m not below high = {self.high:g} m")
        return self


class JointTable(StudyTable):
    """One joint of the machine.

    Attributes
    ----------
    motion : str
        ``"rotary"`` or ``"prismatic"``.
    lifts : str
        What positive motion does.
    moving_mass : float or None
        Upper limit on the mass that moves about a rotary axis [kg]; it bounds the inertia from below.
    drive, loop, limits, slider
        Its tables; `drive` is None where no motor takes part, `loop` where the machine's controller is not known,
        `slider` where the machine has none.
    """

    motion: Literal["rotary", "prismatic"]
    lifts: Said = ""
    moving_mass: quantity("kg", gt=0) | None = None
    drive: Drive | None = None
    loop: Loop | None = None
    limits: JointLimits = JointLimits()
    slider: Slider | None = None

    @model_validator(mode="after")
    def _slider_turns(self) -> JointTable:
        if self.slider is not None and self.motion != "rotary":
            raise ValueError(f'found [rig.slider] with motion = "{self.motion}", expected "rotary"')
        return self

    @property
    def joints(self) -> tuple[JointTable, ...]:
        """This one, as a machine of several gives its own."""
        return (self,)


class OneJoint(JointTable):
    """The machine, of one joint: ``[rig]``. `joint` is what it is called: ``"elbow"``."""

    joint: Word = "joint"


class Body(StudyTable):
    """What hangs on a joint: mass [kg], its centre in the joint's frame [m], and moments about that centre in the
    frame's axes, I_xx I_xy I_xz I_yy I_yz I_zz [kg m^2]."""

    mass: quantity("kg", gt=0)
    centre: InMetres = (0.0, 0.0, 0.0)
    inertia: tuple[(quantity("kg*m^2"),) * 6] = (0.0,) * 6


class RigJoint(JointTable):
    """One of the machine's joints: ``[[rig.joints]]``.

    Attributes
    ----------
    name : str
        What its channels end in: ``position.elbow``; where a robot's file is given, the joint's name in it.
    parent : str or None
        The joint on whose body it is, ``"base"`` for none; None for the one before it in the list.
    place, turned, axis : tuple of float or None
        Where the joint's frame is in its parent's [m], roll, pitch and yaw of it [rad], and the axis in it; None where
        a robot's file says so.
    body : Body or None
        What hangs on it; None where a robot's file says so.
    rotor_inertia : float
        Of the motor's rotor, at the joint [kg m^2; kg].
    turns : dict[str, float]
        How often its motor turns with each joint; what the drive reports is then the motor's.
    zero : float
        Position where motors are at 0, of joints that are known by their motors [rad; m].
    dead_band : float or None
        Slower, it counts as at rest [rad/s; m/s]; None for that of ``[processing]``.
    """

    name: str = Field(pattern=NAME)
    parent: Word | None = None
    place: InMetres | None = None
    turned: tuple[quantity("rad"), quantity("rad"), quantity("rad")] | None = None
    axis: tuple[float, float, float] | None = None
    body: Body | None = None
    rotor_inertia: quantity("<rotor>", ge=0) = 0.0
    turns: dict[str, Annotated[float, Field(ge=-1e5, le=1e5)]] = Field({})
    zero: quantity("<coordinate>") = 0.0
    dead_band: quantity("<velocity>", ge=0) | None = None

    @property
    def joint(self) -> str:
        """What it is called."""
        return self.name

    @property
    def of_a_tree(self) -> tuple[str, ...]:
        """Its keys that mean something only where all joints are identified at once."""
        others = {*JointTable.model_fields, "name"}
        return tuple(key for key in RigJoint.model_fields if key in self.model_fields_set - others)

    @field_validator("axis")
    @classmethod
    def _unit_length(cls, axis: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
        if axis is None:
            return None
        length = math.hypot(*axis)
        if length == 0.0:
            raise ValueError("found [0, 0, 0], which points nowhere")
        return (axis[0] / length, axis[1] / length, axis[2] / length)

    @model_validator(mode="after")
    def _motor_turns_with_it(self) -> RigJoint:
        if self.turns and not self.turns.get(self.name):
            raise ValueError(f"turns: found {self.turns}, expected how often the motor turns with {self.name} itself")
        if self.turns and self.drive is not None and self.drive.gear_ratio != 1.0:
            raise ValueError("found turns and a gear_ratio, expected one of them: turns say the gears")
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
    """The machine, joint by joint: ``[rig]`` with ``[[rig.joints]]``.

    Whoever asks it for what one joint has is told that there are several.

    Attributes
    ----------
    joints : tuple of RigJoint
    """

    joints: tuple[RigJoint, ...] = Field(min_length=1)

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
            raise ValueError(f"found a slider in a machine of {len(self.joints)} joints, expected it with one alone")
        return self

    @model_validator(mode="after")
    def _turn_with_joints(self) -> SeveralJoints:
        names = [joint.name for joint in self.joints]
        for joint in self.joints:
            unknown = [name for name in joint.turns if name not in names]
            if unknown:
                raise ValueError(f'{joint.name}: turns: found "{unknown[0]}", expected joints: {", ".join(names)}')
        return self

    @property
    def refusal(self) -> str:
        """What is said where only one joint is supported."""
        names = ", ".join(joint.name for joint in self.joints)
        return (
            f"study.toml: found {len(self.joints)} joints in [[rig.joints]] ({names}), expected one: without a table "
            "[tree] joints are identified one at a time; add [tree], or make a study of each, whose [channels] name "
            "its columns of the same files"
        )

    def __getattr__(self, name: str) -> Any:
        if name in JointTable.model_fields or name in ("joint", "name"):
            raise StudyError(self.refusal)
        return super().__getattr__(name)


_ONE, _SEVERAL = DERIVED + "one", DERIVED + "several"


def _single(rig: OneJoint | SeveralJoints) -> JointTable | SeveralJoints:
    """A list of one joint is that joint."""
    return rig.joints[0] if len(rig.joints) == 1 else rig


RigTable = Annotated[
    Annotated[OneJoint, Tag(_ONE)] | Annotated[SeveralJoints, Tag(_SEVERAL)],
    Discriminator(lambda table: _SEVERAL if isinstance(table, dict) and "joints" in table else _ONE),
    AfterValidator(_single),
]
"""``[rig]`` in either form."""


class Participant(StudyTable):
    """Who wears it: ``[participants.NAME]``. Mass [kg], height [m], age [years], from the knee to the heel [m]."""

    mass: quantity("kg", gt=0) | None = None
    height: quantity("m", gt=0) | None = None
    age: float | None = Field(None, gt=0)
    sex: Literal["female", "male"] | None = None
    shank_length: quantity("m", gt=0) | None = None


DRIVEN = ("torque", "force", "current", "voltage", "duty")
"""Channels of a drive, whose delay against the position can be estimated."""


def _not_zero(scale: float | None) -> float | None:
    if scale == 0.0:
        raise ValueError("found 0, which makes every sample 0")
    return scale


def _require_column(column: Any) -> None:
    if isinstance(column, bool) or (isinstance(column, int) and column < 0):
        raise ValueError(f"found {column!r}, expected a column's name or its number from 0")


def _constant(table: Mapping[str, Any]) -> dict[str, Any]:
    """A channel that is one value at all times, as a column of it: `value` is a number with its unit."""
    others = sorted(key for key in table if key != "value" and not key.startswith(DERIVED))
    if others or table[DERIVED + "name"] == "time":
        raise ValueError(f"found value beside {', '.join(others) or 'no times'}, expected it alone: it is every sample")
    number, _, unit = str(table["value"]).strip().partition(" ")
    try:
        value = float(number)
    except ValueError:
        raise ValueError(f'value: found {table["value"]!r}, expected a number and its unit, such as "60 deg"') from None
    return {**table, "value": value, "unit": unit, "column": str(table["value"])}


class Subtracted(StudyTable):
    """A column that is taken off another: `column`, as a channel's, and `scale`, the channel's unit per stored count;
    None for the channel's own."""

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
    """Where a channel's numbers are and what they mean: one entry of ``[channels]``.

    In order: stored bits are signed, missing marks become NaN, a rolling encoder is unwrapped, then
    value = sign * (scale * stored - what `minus` takes off) + offset in `unit`, then a rolling value is unwrapped, then
    SI.

    Attributes
    ----------
    name : str
        The channel.
    column : str or int
        Column of a table, dotted path into a structure, or 0-based column number.
    unit : str
        Of the value after `scale`.
    sign : int
        1 or -1.
    offset : float
        Added last, in `unit`.
    scale : float
        `unit` per stored count.
    value : float or None
        What the channel is at all times [unit], in place of a column: of a joint that was held.
    minus : Subtracted or None
        Another column that is taken off: of two cables that pull against each other, of a spring's two ends.
    wrap_bits : int or None
        The stored count rolls over after this many bits.
    wrap : float or None
        The value rolls over after this much [SI].
    signed_bits : int or None
        The count is a signed number of this many bits that was stored unsigned.
    missing : str, float or None
        ``"NaN"``, or the number that marks a missing sample.
    rate : float or None
        Of a file that has no column of times: sample n is at n / rate [Hz].
    clip : str
        ``"refuse"``, or ``"accept"`` where the channel may rest at its largest value.
    delay : str, float or None
        How much later the channel is than the file's time says [s]; ``"auto"`` or None: estimated where it can be.
    lag : float or None
        Time constant of the first-order lag that the channel went through [s].
    si_factor, si_offset : float
        SI value = value * si_factor + si_offset.
    si_unit : str
        SI unit as plain text.
    """

    name: str = Field(validation_alias=DERIVED + "name")
    column: str | int
    unit: str
    sign: Literal[1, -1] = 1
    offset: float = 0.0
    scale: Annotated[float, AfterValidator(_not_zero)] = 1.0
    value: Annotated[float | None, Field(json_schema_extra={"type": "string"})] = None
    minus: Subtracted | None = None
    wrap_bits: int | None = Field(None, ge=6, le=64)
    wrap: Annotated[float | None, Field(gt=0, json_schema_extra={"type": "string"})] = None
    signed_bits: int | None = Field(None, ge=2, le=64)
    missing: Literal["NaN"] | float | None = None
    rate: quantity("Hz", gt=0) | None = None
    clip: Literal["refuse", "accept"] = "refuse"
    delay: Annotated[Literal["auto"] | float | None, Field(json_schema_extra={"type": "string"})] = None
    lag: quantity("s", gt=0) | None = None
    si_factor: float = Field(validation_alias=DERIVED + "si_factor")
    si_offset: float = Field(validation_alias=DERIVED + "si_offset")
    si_unit: str = Field(validation_alias=DERIVED + "si_unit")

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
    def _of_a_signal(self) -> ChannelSpec:
        if self.name == "time" and not self.delay is self.lag is None:
            raise ValueError("found a delay of time, expected one of the channel that is late")
        if self.delay == "auto" and self.name.partition(".")[0] not in DRIVEN:
            raise ValueError(f'found delay = "auto", which is estimated of {", ".join(DRIVEN)} alone; expected a time')
        return self

    @model_validator(mode="before")
    @classmethod
    def _to_si(cls, table: Any, info: ValidationInfo) -> Any:
        if not isinstance(table, dict):
            raise ValueError(f'found {table!r}, expected a table such as {{ column = "q", unit = "rad" }}')
        name = table[DERIVED + "name"]
        if "rate" in table:
            if name != "time" or "column" in table:
                raise ValueError("found rate, which stands in place of the column and the unit of time")
            table = {"column": 0, "unit": "s", **table}
        if "value" in table:
            table = _constant(table)
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
        return {**table, **{DERIVED + key: value for key, value in si.items()}}


class Optical(StudyTable):
    """What the files of a motion capture hold, beside the machine's own: ``[optical]``.

    Attributes
    ----------
    time : ChannelSpec
        The motion capture's own clock.
    unit : str
        Of the coordinates.
    markers : tuple of str
        Names of the markers to read.
    columns : str
        Name of a coordinate's column: ``{marker}`` and ``{axis}`` (x, y, z) stand for what they say.
    down : tuple of float
        Direction of gravity along the lab's axes, of length 1.
    """

    time: ChannelSpec
    unit: str
    markers: tuple[Said, ...]
    columns: str = "{marker}_{axis}"
    down: tuple[float, float, float]

    @model_validator(mode="before")
    @classmethod
    def _name_time(cls, table: Any) -> Any:
        if isinstance(table, dict) and isinstance(table.get("time"), dict):
            return {**table, "time": {**table["time"], DERIVED + "name": "time"}}
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

    @field_validator("markers")
    @classmethod
    def _each_once(cls, markers: tuple) -> tuple:
        if not markers or len(set(markers)) < len(markers):
            raise ValueError(f"found {list(markers)}, expected at least one, each once")
        return markers

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

    @field_validator("down")
    @classmethod
    def _unit_length(cls, down: tuple[float, float, float]) -> tuple[float, float, float]:
        length = math.hypot(*down)
        if length == 0.0:
            raise ValueError("found [0, 0, 0], which points nowhere")
        return (down[0] / length, down[1] / length, down[2] / length)

    @property
    def si_factor(self) -> float:
        """Metres per `unit`."""
        return to_si_factor(self.unit, "m", "")[0]

    def column(self, marker: str, axis: str) -> str:
        """Name of the column with one coordinate of a marker; `axis` is ``"x"``, ``"y"`` or ``"z"``."""
        return self.columns.replace("{marker}", marker).replace("{axis}", axis)


class Stream(StudyTable):
    """Another instrument's files, beside the machine's own: ``[streams.NAME]``.

    Attributes
    ----------
    channels : dict[str, ChannelSpec]
        ``[streams.NAME.channels]``; ``time`` is the instrument's own clock.
    join : bool
        Whether its channels are taken over into the recording, onto the recording's time.
    offset : str or float
        How much later its clock is, once joined [s]; ``"auto"``: found from the motion.
    drift : str or float
        Share by which its clock runs faster; ``"auto"``: found from the motion.
    """

    channels: dict[Word, ChannelSpec]
    join: bool = False
    offset: Annotated[Literal["auto"] | float, Field(json_schema_extra={"type": "string"})] = "auto"
    drift: Annotated[Literal["auto"] | float, Field(json_schema_extra={"type": "string"})] = "auto"

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
            raise ValueError("found offset or drift of a stream on a clock of its own, expected join = true beside it")
        both = {"position", *DRIVEN} & set(self.channels)
        if self.join and not both and "auto" in (self.offset, self.drift):
            raise ValueError(
                'found join = true with neither position nor the drive among its channels: expected offset = "... s" '
                "and drift = 0, since nothing in it tells them"
            )
        return self


class Processing(StudyTable):
    """What is done to the samples before a regression: ``[processing]``.

    Attributes
    ----------
    lowpass : float or None
        Cut-off of the zero-phase low-pass applied to both sides [Hz]; identification needs it.
    order : int
        Of the Butterworth filter, run forwards and backwards.
    decimate : int
        Every how many samples one is kept after filtering.
    resample : float or None
        Uniform rate to interpolate to first, where the clock jitters [Hz].
    dead_band : float
        Samples slower than this are left out [rad/s or m/s].
    trim : int
        Samples dropped at each border, where the filter has not settled.
    velocity : str
        ``"differentiated"`` from the position, or ``"recorded"``: the channel of that name.
    cut : str
        ``"automatic"``: spikes, dropouts, frozen and clipped stretches, gaps and missing samples are left out;
        ``"none"``: they refuse the recording.
    cut_share : float
        Largest share of a recording's samples that may be left out so, in [0, 1).
    """

    lowpass: quantity("Hz", gt=0) | None = None
    order: int = Field(4, ge=1, le=12)
    decimate: int = Field(1, ge=1)
    resample: quantity("Hz", gt=0) | None = None
    dead_band: quantity("<velocity>", ge=0) = 0.0
    trim: int = Field(0, ge=0)
    velocity: Literal["differentiated", "recorded"] = "differentiated"
    cut: Literal["automatic", "none"] = "automatic"
    cut_share: float = Field(0.1, ge=0, lt=1)


class Model(StudyTable):
    """What is identified: ``[model]``.

    Attributes
    ----------
    families : tuple of str
        Friction models to compare.
    gravity : str
        ``"none"``, ``"sine"`` or ``"sine+cosine"`` (the zero of the encoder is not known).
    known : Mapping[str, float]
        Parameters held at a known value, in SI.
    purpose : str
        What the headline's values are for: ``"torque"`` or ``"simulation"``.
    confidence : float
        Of the intervals, in (0, 1).
    posterior : bool
        Whether a posterior is drawn beside the intervals.
    """

    families: tuple[Literal[tuple(FAMILIES)], ...] = DEFAULT_FAMILIES
    gravity: Literal["none", "sine", "sine+cosine"]
    known: dict[str, float] = Field({})
    purpose: Literal["torque", "simulation"] = "torque"
    confidence: float = Field(0.95, gt=0, lt=1)
    posterior: bool = False

    @model_validator(mode="before")
    @classmethod
    def _default_gravity(cls, table: Any, info: ValidationInfo) -> Any:
        if isinstance(table, dict) and "gravity" not in table:
            return {**table, "gravity": "none" if (info.context or {}).get("motion") == "prismatic" else "sine"}
        return table

    @field_validator("families")
    @classmethod
    def _some(cls, families: tuple) -> tuple:
        if not families or len(set(families)) < len(families):
            raise ValueError(f"found {list(families)}, expected at least one, each once")
        return families

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
            if abs(value) > MOST_KNOWN:
                raise ValueError(f"{found} at most {MOST_KNOWN:g} in SI: no such machine has more")
        return values

    @model_validator(mode="after")
    def _no_weight_along_a_slide(self, info: ValidationInfo) -> Model:
        if (info.context or {}).get("motion") == "prismatic" and self.gravity != "none":
            raise ValueError(f'found gravity = "{self.gravity}" with motion = "prismatic", expected "none"')
        return self


class PayloadSpec(StudyTable):
    """A known mass on the moving segment: mass [kg], distance from the axis [m]. Of a robot of several joints: the link
    that carries it, None for the last one, and the mass's centre there [m], None if unknown."""

    mass: quantity("kg", gt=0)
    distance: quantity("m", ge=0) = 0.0
    link: Said | None = None
    centre: InMetres | None = None


class RecordingEntry(StudyTable):
    """One ``[[recordings]]``.

    Attributes
    ----------
    name : str
        The recording's part of an id.
    file, files : str or None
        Path from the study's folder, or a pattern that names several; one of the two.
    protocol : str or None
        ``"swept_sine"``.
    use : str
        ``"fit"`` or ``"validate"``.
    window : tuple of float or None
        Samples with start <= time < end are taken, on the file's own clock [s].
    exclude : tuple of tuple of float
        Samples with start <= time < end are left out, on the file's own clock [s].
    participant, condition : str or None
        Who, and under which condition.
    repetition : int or None
        Which time of several that the same was done, from 1.
    period : int or None
        When the participant did it: 1 what came first, 2 what came then.
    amplitude : float or None
        How far each movement in it was to go, signed [rad or m], where no channel says so.
    payload : PayloadSpec or None
        Known mass carried.
    optical : str or None
        Path of the motion capture's file of the same trial, from the study's folder.
    streams : dict[str, str]
        Paths of other instruments' files of the same trial, by the name of their ``[streams.NAME]``.
    offsets : dict[str, float]
        How much later those instruments' clocks are in this trial [s], where a stream is joined.
    slider : float or None
        Where the carriage was clamped, by a ruler: distance from the axis [m].
    start : str
        Where a simulation of it starts: ``"measured"`` (position and velocity of the first samples) or ``"rest"``.
    processing : Processing or None
        What differs from ``[processing]``; complete. None where nothing does.
    channels : dict[str, ChannelSpec]
        Those that differ from, or are added to, ``[channels]``; complete.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    file: Place | None = None
    files: Place | None = None
    protocol: Word | None = None
    use: Literal["fit", "validate"] = "fit"
    window: tuple[quantity("s"), quantity("s")] | None = None
    exclude: tuple[tuple[quantity("s"), quantity("s")], ...] = ()
    participant: Word | None = None
    condition: Said | None = None
    repetition: int | None = Field(None, ge=1)
    period: int | None = Field(None, ge=1)
    amplitude: quantity("<coordinate>") | None = None
    payload: PayloadSpec | None = None
    optical: Place | None = None
    streams: dict[Word, Place] = Field({})
    offsets: dict[Word, quantity("s")] = Field({})
    slider: quantity("m", ge=0) | None = None
    start: Literal["measured", "rest"] = "measured"
    processing: Processing | None = None
    channels: dict[Word, ChannelSpec] = Field({})

    @model_validator(mode="after")
    def _one_source(self) -> RecordingEntry:
        if (self.file is None) == (self.files is None):
            raise ValueError("expected one of file and files, found " + ("both" if self.file else "neither"))
        if self.files is not None and (self.optical is not None or self.streams):
            what = f'optical = "{self.optical}"' if self.optical is not None else "streams"
            raise ValueError(
                f'found {what} with files = "{self.files}", expected file: each recording has files of its own for them'
            )
        if self.window is not None and self.window[0] >= self.window[1]:
            raise ValueError(f"window: found {self.window[0]:g} s to {self.window[1]:g} s, expected start before end")
        for start, stop in self.exclude:
            if start >= stop:
                raise ValueError(f"exclude: found {start:g} s to {stop:g} s, expected start before end")
        return self


class StudyFile(StudyTable):
    """The whole of study.toml, in SI.

    Attributes
    ----------
    name : str
        First part of every figure's id.
    citation : str
        What to cite for the recordings; printed in the report.
    notes : tuple of str
        Remarks the report repeats.
    rig, participants, channels, optical, streams, processing, model, recordings
        Its tables; `optical` is None where no motion capture took part.

    `study_file_model` adds a field for each table that asks for a procedure, None where it is not there.
    """

    name: str = Field(pattern=NAME)
    citation: str = ""
    notes: tuple[str, ...] = ()
    rig: RigTable
    participants: dict[Word, Participant] = Field({})
    channels: dict[Word, ChannelSpec]
    optical: Optical | None = None
    streams: dict[Word, Stream] = Field({})
    processing: Processing = Processing()
    model: Model
    recordings: tuple[RecordingEntry, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _spread_channels(cls, raw: Any) -> Any:
        """Flatten ``emg.biceps`` and complete each recording's channels by the defaults they override."""
        if not isinstance(raw, dict):
            return raw
        raw = {"model": {}, **raw}
        if isinstance(raw.get("channels"), dict):
            raw["channels"] = _plain_where_single(_flat_channels(raw["channels"]), joint_names(raw))
        entries = raw.get("recordings")
        if isinstance(entries, list) and isinstance(raw.get("channels"), dict):
            raw["recordings"] = [_complete(entry, raw["channels"], joint_names(raw)) for entry in entries]
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
    def _refers_to_what_exists(self) -> StudyFile:
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
            joints = ("velocity", *(f"velocity.{joint.joint}" for joint in self.rig.joints))
            if (entry.processing or self.processing).velocity == "recorded" and not any(
                name in channels for name in joints
            ):
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
    def _says_whose_channels_they_are(self) -> StudyFile:
        names = [joint.joint for joint in self.rig.joints]
        everywhere = {**self.channels, **{n: c for entry in self.recordings for n, c in entry.channels.items()}}
        for name in everywhere if len(names) > 1 else ():
            if name in OF_A_JOINT:
                wanted = ", ".join(f"{name}.{joint}" for joint in names)
                raise ValueError(f"[channels] {name}: found no joint's name in it, expected one of {wanted}")
            head, _, last = name.rpartition(".")
            if head in OF_A_JOINT and last not in names:
                raise ValueError(f'[channels] {name}: found the joint "{last}", expected one of {", ".join(names)}')
        return self

    @model_validator(mode="after")
    def _asks_one_thing(self) -> StudyFile:
        alone = [name for name, table in self.procedures.items() if table.alone]
        if len(alone) > 1:
            raise ValueError(f"found the tables {', '.join(alone)}, expected one of them: each is a study of its own")
        if any(joint.drive is None for joint in self.rig.joints) and not self.procedures:
            raise ValueError("[rig.drive] no such table found, expected one that says how the effort is known")
        for table in self.procedures.values():
            table.require_in(self)
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
                "they are found only where a joint with friction is identified"
            )
        return self

    @model_validator(mode="after")
    def _places_the_slider(self) -> StudyFile:
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
        """What a carriage moves on; None where the machine has none."""
        return next((joint.slider for joint in self.rig.joints if joint.slider is not None), None)

    @property
    def procedures(self) -> dict[str, ProcedureTable]:
        """The tables that ask for a procedure, by their names."""
        found = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: table for name, table in found.items() if isinstance(table, ProcedureTable)}

    def joined_channels(self, stream: str) -> dict[str, ChannelSpec]:
        """Channels that a recording has of a stream."""
        table = self.streams.get(stream)
        return {n: c for n, c in table.channels.items() if n != "time"} if table is not None and table.join else {}

    def entry_of(self, recording: str) -> RecordingEntry | None:
        """What is said of a recording by its name; None of one that is not named, as one held in memory."""
        named = {entry.name: entry for entry in self.recordings}
        begun = [name for name in named if recording == name or recording.startswith(f"{name}.")]
        return named[max(begun, key=len)] if begun else None

    def processing_of(self, recording: str) -> Processing:
        """What is done to the samples of a recording, by its name."""
        entry = self.entry_of(recording)
        return self.processing if entry is None or entry.processing is None else entry.processing

    def channels_of(self, entry: RecordingEntry) -> dict[str, ChannelSpec]:
        """All channels of one recording's own file: the defaults, with its own in their place."""
        return {**self.channels, **entry.channels}


def study_file_model(tables: Mapping[str, type[ProcedureTable]]) -> type[StudyFile]:
    """`StudyFile` with a field for each table, by its name, that may ask for a procedure."""
    fields: dict[str, Any] = {name: (table | None, None) for name, table in tables.items()}
    return create_model("StudyFile", __base__=StudyFile, **fields)


# What the last or last but one part of a dotted name says of its unit.
_PARTS = {
    "acceleration": "m/s^2", "angular_velocity": "rad/s", "magnetic_field": "T", "orientation": "1", "angle": "rad",
    "moment": "N*m", "length": "m", "lengthening": "m/s", "moment_arm": "m",
}  # fmt: skip


OF_A_JOINT = frozenset(
    ("position", "reference", "velocity", "acceleration", "current", "voltage", "duty", "supply", "torque", "force",
     "enabled", "temperature", "motor_position", "target", "interaction", "desired_current", "desired_torque")
)  # fmt: skip
"""Channels that are a joint's: where a machine has several, their names end in its name."""


def channel_unit(name: str, units: Mapping[str, Any], given: str | None = None) -> str | None:
    """SI unit a channel must have, by its name; None where any unit is meaningful."""
    fixed = {
        "time": "s", "position": "<coordinate>", "reference": "<reference>", "velocity": "<velocity>",
        "acceleration": "<acceleration>", "current": "A", "voltage": "V", "duty": "1", "supply": "V", "torque": "N*m",
        "force": "N", "enabled": "1", "temperature": "K", "motor_position": "<motor>",
        "target": "<coordinate>", "interaction": "<effort>", "desired_current": "A", "desired_torque": "<effort>",
    }  # fmt: skip
    head, _, joint = name.rpartition(".")
    own = units.get("joints", {}).get(joint)
    if own is not None and (head in OF_A_JOINT or head == own["injected"]):
        return channel_unit(head, own, given)
    expected = fixed.get(name)
    parts = name.split(".")
    if parts[0] == "moment" and given in ("MVC", "%MVC"):
        return "MVC"
    if expected is None and parts[0] == "emg" and len(parts) > 1:
        expected = "1" if given in ("1", "%") else "V"
    if expected is None and len(parts) > 1:
        expected = next((_PARTS[part] for part in (parts[-2], parts[0]) if part in _PARTS), None)
    if expected is None and name == units.get("injected"):
        expected = "<injected>"
    return units.get(expected, expected) if expected else None


def parameter_units(name: str, units: Mapping[str, str | None]) -> tuple[str, ...] | None:
    """SI units a known parameter may have, by its name; None where the name says nothing."""
    effort, coordinate = units["<scaled_effort>"], units["<coordinate>"]
    if effort is None or coordinate is None:
        return None
    per_acceleration = f"{effort}*s^2/{coordinate}"
    kind = name.split("_")[0]
    if kind in ("inertia", "mass"):
        return {"N*m": ("kg*m^2", per_acceleration), "N": ("kg", per_acceleration)}.get(effort, (per_acceleration,))
    if name in SYMBOLS_BY_NAME:
        return (SYMBOLS_BY_NAME[name].unit("rotary" if coordinate == "rad" else "prismatic", effort),)
    return None


def joint_names(raw: Mapping[str, Any]) -> list[str]:
    """Names in ``[[rig.joints]]``, from the raw text of study.toml; empty in the other form of ``[rig]``."""
    rig = raw.get("rig") if isinstance(raw.get("rig"), dict) else {}
    tables = rig.get("joints") if isinstance(rig.get("joints"), list) else []
    return [t["name"] for t in tables if isinstance(t, dict) and isinstance(t.get("name"), str)]


def rig_units(raw: Mapping[str, Any]) -> dict[str, Any]:
    """SI units that follow from a joint's motion and drive, from the raw text of study.toml.

    Those of a machine's only joint; under ``"joints"`` those of each in ``[[rig.joints]]``, by name.
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
    # What is of no joint alone, such as a dead band, has the unit that all share, if they do.
    alike = units[names[0]]
    for other in list(units.values())[1:]:
        alike = {key: value if other[key] == value else None for key, value in alike.items()}
    return {**alike, "joints": units}


def _joint_units(rig: Mapping[str, Any], channels: Collection[str]) -> dict[str, str | None]:
    drive = rig.get("drive") if isinstance(rig.get("drive"), dict) else {}
    loop = rig.get("loop") if isinstance(rig.get("loop"), dict) else {}
    motion, kind = (x if isinstance(x, str) else None for x in (rig.get("motion"), drive.get("kind")))
    # Without a valid motion or kind nothing is expected of a unit, so that only the true cause is told.
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
        "<scaled_effort>": effort if known else electrical,
        "<constant>": effort and per and f"{effort}/{per}",
        "<command>": "1" if duty else electrical,
        "<injected>": electrical,
    }


def parse_study_file(path: Path, model: type[StudyFile] = StudyFile) -> StudyFile:
    """Read and check a study.toml."""
    import tomllib

    try:
        text = read_given(path, MOST_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        raise StudyError(f"{path}: no such file; a study is a folder with a study.toml in it") from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: not readable: {error}") from error
    try:
        raw = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{path}: not valid TOML: {error}") from error
    try:
        return model.model_validate(raw, context=rig_units(raw))
    except ValidationError as error:
        raise StudyError(explain(error, path, text, model)) from None
    except StudyError:
        raise
    except (TypeError, ValueError, KeyError, AttributeError, ArithmeticError, RecursionError) as error:
        # What stands where another type is expected may break what looks at it before its own check.
        raise StudyError(f"{path}: not understood: {type(error).__name__}: {error}") from error


def json_schema(model: type[StudyFile] = StudyFile) -> dict[str, Any]:
    """JSON Schema of study.toml, for editors that complete and check as one types."""
    schema = model.model_json_schema()
    channel = schema["$defs"]["ChannelSpec"]
    channel["properties"] = {key: value for key, value in channel["properties"].items() if key[0] != DERIVED}
    channel["required"] = ["column", "unit"]
    one = {"$ref": "#/$defs/ChannelSpec"}
    # emg.biceps is a table in a table; a recording's own channel may give only what differs.
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
            flat[name] = {**table, DERIVED + "name": name} if isinstance(table, dict) else table
    return flat


def _plain_where_single(channels: dict[str, Any], joints: list[str]) -> dict[str, Any]:
    """A machine's only joint may be left out of its channels' names, and is."""
    if len(joints) != 1:
        return channels

    def plain(name: str) -> str:
        head = name.removesuffix(f".{joints[0]}")
        return head if head in OF_A_JOINT else name

    return {
        plain(name): {**table, DERIVED + "name": plain(name)} if isinstance(table, dict) else table
        for name, table in channels.items()
    }


def _complete(entry: Any, defaults: Mapping[str, Any], joints: list[str]) -> Any:
    if not isinstance(entry, dict) or not isinstance(entry.get("channels"), dict):
        return entry
    own = _plain_where_single(_flat_channels(entry["channels"]), joints)
    merged = {
        name: {**defaults[name], **table} if isinstance(table, dict) and _adds_to(defaults.get(name), table) else table
        for name, table in own.items()
    }
    return {**entry, "channels": merged}


def _adds_to(default: Any, own: Mapping[str, Any]) -> bool:
    """Whether a recording's channel differs from the study's; a constant beside a column is another one."""
    return isinstance(default, dict) and ("value" in default) == ("value" in own)
