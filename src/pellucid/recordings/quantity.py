"""Say what a column of a log probably holds, by its name and unit alone: a quantity, and whether it is a command."""

from __future__ import annotations

import re
from dataclasses import dataclass

from .._errors import PellucidError
from ..units import si_text, to_si_factor

_QUANTITY_WORDS = {
    "switch": {"enable", "enabled", "state", "mode", "flag", "status", "trigger", "switch", "button", "sync", "label"},
    "time": {"time", "t", "timestamp", "stamp", "secs", "clock", "zeit"},
    "emg": {"emg", "semg"},
    "torque": {"torque", "tau", "moment", "trq", "effort", "drehmoment"},
    "force": {"force", "grf", "loadcell", "kraft"},
    "current": {"current", "cur", "curr", "iq", "strom"},
    "voltage": {"voltage", "volt", "spannung"},
    "duty": {"duty", "pwm"},
    "velocity": {"velocity", "vel", "speed", "omega", "qd", "dq", "gyro", "geschwindigkeit"},
    "acceleration": {"acceleration", "acc", "accel", "qdd", "ddq"},
    "position": {"position", "pos", "angle", "theta", "q", "encoder", "enc", "displacement", "winkel"},
    "stiffness": {"stiffness", "k"},
    "damping": {"damping", "b"},
    "temperature": {"temperature", "temp"},
}
"""Words of a column's name that name its quantity; the first quantity with such a word counts."""

_QUANTITY_BY_UNIT = {
    "s": "time", "rad": "position", "m": "position", "rad/s": "velocity", "m/s": "velocity", "rad/s^2": "acceleration",
    "m/s^2": "acceleration", "N*m": "torque", "N": "force", "A": "current", "V": "voltage", "K": "temperature",
    "N*m/rad": "stiffness", "N/m": "stiffness", "N*m*s/rad": "damping", "N*s/m": "damping", "MVC": "emg",
}  # fmt: skip
"""Quantity of a column whose unit is known, by its SI unit."""

COMMAND_WORDS = frozenset(
    {"desired", "des", "cmd", "command", "commanded", "ref", "reference", "target", "setpoint", "soll", "goal",
     "planned", "applied", "demand", "demanded", "asked"}
)  # fmt: skip
"""Words of a column's name that say that it was asked for, not measured."""

COMPUTED_WORDS = frozenset({"error", "err", "feedforward", "feedback", "ff", "fb", "gain", "estimated", "model"})
"""Words of a column's name that say that a program computed it from other columns."""

MEASURED_WORDS = frozenset({"measured", "meas", "actual", "act", "sensor", "present", "ist"})
"""Words of a column's name that say that it was measured."""

EFFORT_QUANTITIES = ("torque", "force", "current", "voltage", "duty")
"""Quantities that drive a joint."""

_WRITTEN_UNITS = {
    "Nm": "N*m", "Nmm": "N*mm", "mNm": "mN*m", "Nm/rad": "N*m/rad", "Nm/deg": "N*m/deg", "Nm/rad/s": "N*m*s/rad",
    "Nms/rad": "N*m*s/rad", "degrees": "deg", "sec": "s", "seconds": "s", "msec": "ms", "usec": "us", "uV": "uV",
    "rads": "rad/s", "degs": "deg/s", "rads-1": "rad/s", "mps": "m/s", "volts": "V", "amps": "A",
}  # fmt: skip
"""Spellings of units in the names of columns, and the same unit as Pellucid writes it."""

_LONE_UNIT_LETTERS = frozenset("sAVN")
"""Single letters that count as a unit at the end of a name; others are more often part of the name."""


@dataclass(frozen=True)
class Quantity:
    """The probable content of a column.

    Attributes
    ----------
    kind : str
        ``"time"``, ``"position"``, ``"torque"``, ``"emg"``, ...; ``""`` if neither name nor unit tells.
    role : str
        ``"command"``, ``"computed"``, ``"measured"``, or ``""`` if the name does not say.
    unit : str
        SI unit as plain text; ``""`` if it is not stated.
    factor : float
        Factor from the file's numbers to SI; 1 without a unit.
    """

    kind: str
    role: str
    unit: str
    factor: float = 1.0


def quantity_of(name: str, unit: str = "") -> Quantity:
    """Return what a column with this name, and the unit that the file states for it, probably holds.

    Parameters
    ----------
    name : str
        Name of the column, such as ``"Applied_Torque_Nm"`` or ``"t [ms]"``.
    unit : str
        Unit that the file states apart from the name; "" for none.
    """
    known = {word.casefold() for word in _words(name)}
    text, factor = _si(unit or _unit_in(name))
    kind = next((k for k, names in _QUANTITY_WORDS.items() if known & names), "")
    if text and text != "1" and kind != "switch":
        by_unit = _QUANTITY_BY_UNIT.get(text, "")
        # Muscles' potentials and supply voltages share a unit, times and durations too.
        kind = kind if kind in ("emg", "stiffness", "damping") or not by_unit else by_unit
        if by_unit == "time" and not known & _QUANTITY_WORDS["time"]:
            kind = ""
    if known & COMPUTED_WORDS:
        role = "computed"
    elif known & COMMAND_WORDS:
        role = "command"
    else:
        role = "measured" if known & MEASURED_WORDS else ""
    return Quantity(kind, role, text, factor)


def joint_words(name: str) -> str:
    """Return what a column's name holds beside words for quantities, roles and units, in lower case: its joint."""
    unit = _unit_in(name)
    plain = name[: -len(unit)] if unit and name.endswith(unit) else name
    used = {word for words in _QUANTITY_WORDS.values() for word in words}
    used |= COMMAND_WORDS | COMPUTED_WORDS | MEASURED_WORDS | {"joint", "motor", "value"}
    parts = re.findall(r"[A-Za-z]+|\d+", re.sub(r"[\[(].*?[\])]", " ", plain))
    return " ".join(part.casefold() for part in parts if part.casefold() not in used)


def _words(name: str) -> list[str]:
    """Return the words of a column's name: parts between separators, and parts that begin with a capital.

    A single letter counts only if it is a part of its own, q also before a number. A lone t is the whole name.
    """
    plain = re.sub(r"[\[(].*?[\])]", " ", name).strip()
    words: list[str] = []
    for part in re.split(r"[^A-Za-z0-9]+", plain):
        found = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", part)
        alone = len(part) == 1 or part.rstrip("0123456789").casefold() == "q"
        words += [word for word in found if len(word) > 1 or alone]
    return [word for word in words if word.casefold() != "t" or plain.casefold() in ("t", "t_s", "t_ms", "t_us")]


def _unit_in(name: str) -> str:
    """Return the unit that a column's name states in brackets or in its last words; "" for none."""
    bracketed = re.search(r"[\[(]([^\])]+)[\])]\s*$", name)
    if bracketed:
        return bracketed[1].strip()
    parts = name.split("_")
    for first in range(1, len(parts)):
        text = "_".join(parts[first:]).replace("_per_", "/").replace("_", "*")
        if (len(text) > 1 or text in _LONE_UNIT_LETTERS) and _si(text)[0]:
            return text
    return ""


def _si(written: str) -> tuple[str, float]:
    """Return a unit's SI unit and its factor; ("", 1.0) if it is no unit."""
    text = _WRITTEN_UNITS.get(written.strip(), written.strip())
    if not text:
        return "", 1.0
    try:
        factor, offset = to_si_factor(text, None)
        return ("", 1.0) if offset else (si_text(text), factor)
    except PellucidError:
        return "", 1.0
