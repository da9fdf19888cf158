"""The constants of a rig's file: one frozen class for each table, whose fields state their types and bounds.

Each kind of rig derives its tables from `RigTable` and its whole file from `RigConstants`. The types below say each
bound once. They exclude what no machine or person can be; a machine that is ten times as heavy as a shipped one is
accepted. Rates, durations and counts, with which the work of a simulation grows, have close upper bounds. All bounds
are chosen by judgement; no measurement is recorded. All numbers are in SI units, angles in radians.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Annotated, Any, Literal, Self, get_args, get_origin

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from pellucid._errors import StudyError
from pellucid._given import visible_text
from pellucid.study.toml_place import format_place, line_of

MAX_TEXT_LENGTH = 1000
"""Largest number of characters of a text in a rig's file."""

MAX_ENTRY_COUNT = 1000
"""Largest number of entries of a list or a table in a rig's file."""

MAX_INTEGER = 2**53
"""Largest size of an integer in a rig's file. Larger ones are not exact as floating-point numbers."""

MAX_QUOTED_LENGTH = 100
"""Largest number of characters of a found value that a message quotes."""


def _require_visible(text: str) -> str:
    """Return a text; raise a ValueError if it has invisible characters."""
    if visible_text(text) != text:
        raise ValueError(f"found {_shorten(text)}, expected a text without invisible characters")
    return text


Text = Annotated[str, Field(max_length=MAX_TEXT_LENGTH), AfterValidator(_require_visible)]
"""Short text without invisible characters."""

Motion = Literal["rotary", "prismatic"]
"""Way in which a joint moves, as study.toml says it."""

Mass = Annotated[float, Field(ge=1e-4, le=1e4)]
"""Mass of a body [kg]."""

Length = Annotated[float, Field(ge=1e-4, le=100.0)]
"""Length or distance that is not 0 [m]."""

Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]
"""Coordinate of a point, of either sign [m]."""

Inertia = Annotated[float, Field(ge=1e-9, le=1e4)]
"""Moment of inertia about an axis [kg*m^2]."""

InertiaProduct = Annotated[float, Field(ge=-1e4, le=1e4)]
"""Product of inertia, of either sign [kg*m^2]."""

Angle = Annotated[float, Field(ge=-100.0, le=100.0)]
"""Angle, of either sign [rad]."""

AngleSize = Annotated[float, Field(ge=0.0, le=100.0)]
"""Size of an angle, such as a backlash or a standard deviation [rad]."""

PositiveAngle = Annotated[float, Field(ge=1e-5, le=100.0)]
"""Angle above 0 [rad]."""

Speed = Annotated[float, Field(ge=0.0, le=1e4)]
"""Speed at which an effect changes [rad/s]; 0 switches the effect off."""

PositiveSpeed = Annotated[float, Field(ge=1e-5, le=1e4)]
"""Speed above 0 [rad/s]."""

Acceleration = Annotated[float, Field(ge=1e-3, le=1e6)]
"""Limit of an acceleration [rad/s^2]."""

Torque = Annotated[float, Field(ge=0.0, le=1e5)]
"""Size of a torque, such as a friction level [N*m]; of a force where a joint is prismatic [N]."""

SignedTorque = Annotated[float, Field(ge=-1e5, le=1e5)]
"""Torque of either sign [N*m]."""

TorqueLimit = Annotated[float, Field(ge=1e-3, le=1e6)]
"""Largest torque of a drive or a muscle [N*m]."""

Viscosity = Annotated[float, Field(ge=0.0, le=1e4)]
"""Torque per speed [N*m*s/rad]; force per speed where a joint is prismatic [N*s/m]."""

RootViscosity = Annotated[float, Field(ge=0.0, le=1e4)]
"""Torque per root of the speed [N*m/(rad/s)^0.5]."""

Stiffness = Annotated[float, Field(ge=1e-3, le=1e7)]
"""Torque per angle [N*m/rad]."""

OptionalStiffness = Annotated[float, Field(ge=0.0, le=1e7)]
"""Torque per angle [N*m/rad]; 0 switches the effect off."""

Compliance = Annotated[float, Field(ge=0.0, le=1.0)]
"""Angle or angular speed per torque [rad/(N*m)] or [rad/(N*m*s)]."""

Share = Annotated[float, Field(ge=0.0, le=10.0)]
"""Share of another quantity [1]."""

SignedShare = Annotated[float, Field(ge=-10.0, le=10.0)]
"""Share of either sign [1]."""

LogarithmSpread = Annotated[float, Field(ge=0.0, le=5.0)]
"""Standard deviation of a constant's natural logarithm between people [1]."""

Noise = Annotated[float, Field(ge=0.0, le=1e3)]
"""Standard deviation of a disturbance or of a reading, in the unit of what is disturbed."""

Quantum = Annotated[float, Field(ge=1e-20, le=1.0)]
"""Step of a converter, in the unit of what it reads."""

Gain = Annotated[float, Field(ge=0.0, le=1e6)]
"""Gain of a controller, in the unit that its field states."""

WaveNumber = Annotated[float, Field(ge=0.0, le=1e5)]
"""Phase of a ripple per angle of the joint [1/rad]."""

TorqueConstant = Annotated[float, Field(ge=1e-5, le=1e4)]
"""Torque of a motor per ampere [N*m/A]."""

GearRatio = Annotated[float, Field(ge=1e-2, le=1e5)]
"""Angle of a motor over the angle of its joint [1]."""

Current = Annotated[float, Field(ge=1e-3, le=1e4)]
"""Limit of a motor's current [A]."""

Delay = Annotated[float, Field(ge=0.0, le=10.0)]
"""Delay or lag [s]."""

TimeConstant = Annotated[float, Field(ge=1e-5, le=1e4)]
"""Time constant above 0 [s]."""

Memory = Annotated[float, Field(ge=0.0, le=1e3)]
"""Correlation time of noise [s]; 0 means white noise."""

PerSecond = Annotated[float, Field(ge=0.0, le=100.0)]
"""Rate at which a state changes [1/s]."""

ClockOffset = Annotated[float, Field(ge=-100.0, le=100.0)]
"""Time of one instrument's start after another's [s]."""

ClockDrift = Annotated[float, Field(ge=-0.02, le=0.02)]
"""Share by which a clock is fast or slow [1]."""

Frequency = Annotated[float, Field(ge=1e-3, le=1e5)]
"""Frequency [Hz]."""

Rate = Annotated[float, Field(ge=10.0, le=10_000.0)]
"""Rate of a controller and of its recording [Hz]. The work grows with it."""

EmgRate = Annotated[float, Field(ge=100.0, le=20_480.0)]
"""Rate of an EMG amplifier [Hz]. The work grows with it."""

CameraRate = Annotated[float, Field(ge=5.0, le=2000.0)]
"""Rate of cameras [Hz]. The work grows with it."""

ImuRate = Annotated[float, Field(ge=2.0, le=2000.0)]
"""Rate of an inertial sensor [Hz]. The work grows with it."""

Duration = Annotated[float, Field(ge=0.5, le=600.0)]
"""Duration of a recording [s]. The work grows with it."""

Voltage = Annotated[float, Field(ge=0.0, le=100.0)]
"""Size of a voltage [V]."""

Repetitions = Annotated[int, Field(ge=1, le=100)]
"""Number of repetitions. The work grows with it."""

Substeps = Annotated[int, Field(ge=1, le=100)]
"""Number of integration steps in a control period. The work grows with it."""

SampleCount = Annotated[int, Field(ge=0, le=1000)]
"""Number of samples or control periods."""

SampleSpan = Annotated[int, Field(ge=1, le=1000)]
"""Number of samples that a difference spans."""

EncoderCounts = Annotated[int, Field(ge=16, le=2**40)]
"""Counts of an encoder in a turn [1]."""

Seed = Annotated[int, Field(ge=0, le=2**53)]
"""Seed of a random generator."""

Age = Annotated[float, Field(ge=1.0, le=150.0)]
"""Age of a person [years]."""

BodyHeight = Annotated[float, Field(ge=0.3, le=3.0)]
"""Height of a person who stands [m]."""

BodyMass = Annotated[float, Field(ge=2.0, le=600.0)]
"""Mass of a person [kg]."""

Ranges = Annotated[dict[Text, tuple[float, float]], Field(max_length=MAX_ENTRY_COUNT)]
"""Lower and upper end of a uniform draw, by the dotted path of the constant that is drawn."""


class RigTable(BaseModel):
    """A table of a rig's file: frozen, with no other keys than its fields.

    ``table["key"]`` is the field that the file calls ``key``, and ``**table`` are all fields that have a value, so that
    scripts can look a constant up by its name in the file. Field names are attributes: ``table.key``.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, populate_by_name=True)

    @classmethod
    def key_names(cls) -> Mapping[str, str]:
        """Return the name of each field by its key in the file, in the order of the class."""
        return _field_names(cls)

    def __getitem__(self, key: str) -> Any:
        """Return the value of a key of the file; raise a KeyError if the table has no such key."""
        name = type(self).key_names().get(key)
        if name is None:
            raise KeyError(key)
        return getattr(self, name)

    def keys(self) -> tuple[str, ...]:
        """Return the keys of all fields that have a value, in the order of the class."""
        return tuple(key for key, name in type(self).key_names().items() if getattr(self, name) is not None)

    def items(self) -> Iterator[tuple[str, Any]]:
        """Return keys and values of all fields that have a value."""
        return ((key, self[key]) for key in self.keys())

    def get(self, key: str, default: Any = None) -> Any:
        """Return the value of a key, or `default` if it has none."""
        return self[key] if key in self.keys() else default

    def __contains__(self, key: object) -> bool:
        """Return whether a key has a value."""
        return key in self.keys()


class CamerasTable(RigTable):
    """``[cameras]``: motion capture, without the joint that stands still before it."""

    rate: CameraRate  # frame rate [Hz]
    noise: Noise  # standard deviation of each coordinate [m]
    quantum: Quantum  # step in which coordinates are stored [m]
    clock_drift: ClockDrift  # share by which the cameras' clock is fast [1]


@cache
def _field_names(table: type[RigTable]) -> Mapping[str, str]:
    """Return the name of each field of a table by its key in the file."""
    return {field.alias or name: name for name, field in table.model_fields.items()}


class RigConstants(RigTable):
    """All tables of a rig's file; each kind of rig derives a class from it."""

    kind: Text = "bench-joint"  # Kind of the rig; a file that names none describes a joint on a bench.

    @classmethod
    def from_tables(cls, tables: Mapping[str, Any], where: str, text: str = "") -> Self:
        """Read the tables of a file.

        Raises
        ------
        StudyError
            If a table or a key is missing or unknown, or a value is not of its type or out of its bounds. The message
            has one line for each problem: file, line if `text` is given, table, key, found value and expected value.
        """
        try:
            return cls.model_validate(_as_constants(tables, where))
        except ValidationError as error:
            raise StudyError(_explain_problems(error, where, text, cls)) from None

    def as_tables(self) -> dict[str, Any]:
        """Return all that the file says as nested dictionaries, lists as tuples."""
        return self.model_dump(by_alias=True, exclude_unset=True)

    def with_values(self, values: Mapping[str, Any], where: str) -> Self:
        """Return the constants with other values, by the dotted path of each constant.

        Raises
        ------
        StudyError
            If a path names no constant, or a value is not of its type or out of its bounds.
        """
        tables = self.as_tables()
        for path, value in values.items():
            *parents, key = path.split(".")
            model: Any = self
            table = tables
            for parent in parents:
                model = model.get(parent) if isinstance(model, (RigTable, dict)) else None
                table = table.setdefault(parent, {}) if model is not None else table
            known = type(model).key_names() if isinstance(model, RigTable) else model
            if not isinstance(known, Mapping) or key not in known:
                raise StudyError(f"{where} has no constant {path}")
            table[key] = value
        return type(self).from_tables(tables, where)


def _as_constants(value: Any, where: str, depth: int = 0) -> Any:
    """Return a value of a TOML file with tuples for lists and Python's numbers for NumPy's.

    Raises a StudyError if tables are nested too deeply, a list is too long or an integer is too large.
    """
    if depth > 8:
        raise StudyError(f"{where}: found tables or lists that are nested {depth} deep, expected at most 8")
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, RigTable):
        value = value.model_dump(by_alias=True, exclude_unset=True)
    if isinstance(value, Mapping):
        return {str(key): _as_constants(inner, where, depth + 1) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        if len(value) > MAX_ENTRY_COUNT:
            raise StudyError(f"{where}: found a list of {len(value)} entries, expected at most {MAX_ENTRY_COUNT}")
        return tuple(_as_constants(inner, where, depth + 1) for inner in value)
    if isinstance(value, int) and abs(value) > MAX_INTEGER:
        raise StudyError(f"{where}: found {_shorten(value)}, expected an integer of size {MAX_INTEGER} at most")
    return value


def _explain_problems(error: ValidationError, where: str, text: str, root: type[RigConstants]) -> str:
    """Return one line of text for each problem of a rig's file, missing keys last."""
    described: list[str] = []
    missing: dict[tuple[str | int, ...], list[str]] = {}
    for problem in error.errors(include_url=False):
        place = problem["loc"]
        if problem["type"] == "missing":
            missing.setdefault(place[:-1], []).append(str(place[-1]))
        elif problem["type"] == "extra_forbidden":
            keys = ", ".join(_keys_at(root, place[:-1]))
            message = f"{_table_name(place[:-1])}: found {visible_text(str(place[-1]))[:50]}, expected some of {keys}"
            described.append(f"{_file_line(where, text, place)}: {message.lstrip(': ')}")
        else:
            shown = format_place(tuple(visible_text(str(part))[:50] for part in place))
            message = f"{shown}: {_describe_problem(problem)}"
            described.append(f"{_file_line(where, text, place)}: {message.lstrip(': ')}")
    lines = list(dict.fromkeys(described))
    for place, absent in missing.items():
        named = [key for key in absent if not place and _is_family(root, key)]
        lines += [f"{where}: found no [{key}.NAME], expected at least one" for key in named]
        lacking = [key for key in absent if key not in named]
        if lacking:
            head = f"{_file_line(where, text, place)}: {_table_name(place)}".rstrip()
            lines.append(f"{head} lacks {', '.join(lacking)}")
    return "\n".join(lines)


def _file_line(where: str, text: str, place: tuple[str | int, ...]) -> str:
    """Return the file, and the line of the place in its text if it is known."""
    number = line_of(text, place) if text and place else None
    return f"{where}, line {number}" if number else where


def _table_name(place: tuple[str | int, ...]) -> str:
    """Return the name of a table in brackets; the head of the file has none."""
    return f"[{'.'.join(visible_text(str(part))[:50] for part in place)}]" if place else ""


def _is_family(root: type[RigConstants], key: str) -> bool:
    """Return whether a key of the file stands for tables whose names the author chooses."""
    field = root.model_fields.get(root.key_names().get(key, ""))
    return field is not None and get_origin(field.annotation) is dict


def _describe_problem(problem: Any) -> str:
    """Return what was found and what was expected, of a problem that is no missing or unknown key."""
    found, context = _shorten(problem.get("input")), problem.get("ctx", {})
    kind = problem["type"]
    if kind == "value_error":
        return str(context["error"])
    if kind == "literal_error":
        return f"found {found}, expected {context['expected']}"
    if kind in ("greater_than_equal", "less_than_equal"):
        word, bound = ("at least", "ge") if kind == "greater_than_equal" else ("at most", "le")
        return f"found {found}, expected {word} {context[bound]:g}"
    expected = {
        "model_type": "a table",
        "dict_type": "a table",
        "tuple_type": "a list",
        "float_type": "a number",
        "int_type": "a whole number",
        "string_type": "a text",
        "bool_type": "true or false",
        "finite_number": "a finite number",
    }.get(kind)
    message = str(problem["msg"])
    return f"found {found}, expected {expected}" if expected else f"found {found}: {message[:1].lower()}{message[1:]}"


def _keys_at(model: Any, place: tuple[str | int, ...]) -> tuple[str, ...]:
    """Return the keys that the table at a place of the file may have."""
    if isinstance(model, type) and issubclass(model, RigTable):
        if not place:
            return tuple(model.key_names())
        name = model.key_names().get(str(place[0]))
        return _keys_at(model.model_fields[name].annotation, place[1:]) if name else ()
    inner = [argument for argument in get_args(model) if argument is not type(None)]
    # In a dictionary, the first part of the place is a name that the file's author chose.
    return _keys_at(inner[-1], place[1:] if get_origin(model) is dict else place) if inner else ()


def _shorten(value: Any) -> str:
    """Return a value as a message quotes it."""
    try:
        return visible_text(repr(value))[:MAX_QUOTED_LENGTH]
    except ValueError:  # Python refuses to write an integer of more than 4300 digits.
        return "a number of too many digits"
