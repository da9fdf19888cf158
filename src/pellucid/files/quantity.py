"""Say what a column of a log probably holds, by its name and unit alone: a quantity, and whether it is a command.

Words and units are those of `name_evidence.py`, by which `init` names the columns of a lab's files.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..units import si_text, to_si_factor
from .name_evidence import (
    COMMAND_WORDS,
    COMPUTED_WORDS,
    MEASURED_WORDS,
    QUANTITY_WORDS,
    NameEvidence,
    quantity_of_unit,
    read_name,
    with_stated_unit,
    words_of,
)

EFFORT_QUANTITIES = ("torque", "force", "current", "voltage", "duty")
"""Quantities that drive a joint."""

SETTING_WORDS = frozenset({
    "limit", "limits", "lim", "max", "min", "maximum", "minimum", "threshold", "gain", "gains", "mode", "setting",
    "settings", "config", "parameter", "param", "rated", "rating", "tolerance", "bound", "ratio", "constant", "const",
    "offset", "bias", "baud", "version", "id", "address", "kp", "ki", "kd",
})  # fmt: skip
"""Words of names of columns that a user sets and that nothing measures."""

KINDS_OF_SENSORS = {"angular_velocity": "velocity", "linear_acceleration": "acceleration"}
"""Kinds of quantities that only the sensor distinguishes from those of a joint."""


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
        SI unit as plain text; ``""`` if it is not stated, or is not known.
    factor : float
        Factor from the file's numbers to SI; 1 without a unit.
    stated : str
        Unit as the file states it, as plain text; ``""`` without one.
    """

    kind: str
    role: str
    unit: str
    factor: float = 1.0
    stated: str = ""

    @property
    def can_be_measured(self) -> bool:
        """Whether the name does not say that the column was commanded or computed."""
        return self.role in ("", "measured")


def quantity_of(name: str, unit: str = "") -> Quantity:
    """Return what a column with this name, and the unit that the file states for it, probably holds.

    Parameters
    ----------
    name : str
        Name of the column, such as ``"Applied_Torque_Nm"`` or ``"t [ms]"``.
    unit : str
        Unit that the file states apart from the name; "" for none.
    """
    found = with_stated_unit(read_name(name), unit)
    kind = _kind_of_error(found) if found.quantity == "error" else found.quantity or ""
    text, factor = _si(found.unit)
    roles = {"computed": found.is_computed, "command": found.is_command, "measured": found.is_measured}
    role = next((role for role, is_said in roles.items() if is_said), "")
    return Quantity(KINDS_OF_SENSORS.get(kind, kind), role, text, factor, found.unit or "")


def is_setting(name: str) -> bool:
    """Return whether a word of a column's name says that it holds a setting, such as a limit or a gain."""
    return bool(SETTING_WORDS.intersection(words_of(name)))


def joint_words(name: str) -> str:
    """Return a column's joint: the words of its name, in lower case, other than those for quantities, roles and
    units.
    """
    used = {word for words in QUANTITY_WORDS.values() for word in words}
    used |= COMMAND_WORDS | COMPUTED_WORDS | MEASURED_WORDS | {"joint", "motor", "value"}
    plain = re.sub(r"[\[(].*?[\])]", " ", read_name(name).bare)
    return " ".join(word for word in words_of(plain) if word not in used)


def _kind_of_error(found: NameEvidence) -> str:
    """Return the quantity whose error a column holds; "" if neither its unit nor its other words tell."""
    by_unit = quantity_of_unit(found.unit) if found.unit else None
    rest = " ".join(word for word in words_of(found.bare) if word not in QUANTITY_WORDS["error"])
    return by_unit or (read_name(rest).quantity if rest else None) or ""


def _si(unit: str | None) -> tuple[str, float]:
    """Return the SI unit and the factor of a unit; ("", 1.0) without one, and for scales with a zero of their own."""
    if unit is None:
        return "", 1.0
    factor, offset = to_si_factor(unit, None)
    return ("", 1.0) if offset else (si_text(unit), factor)
