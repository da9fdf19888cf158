"""Format numbers and units for readers: rounded by their uncertainty, in degrees or millimetres, in words.

Sentences and cells of tables get their typography here, too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ...models.estimates import Parameter
from ...models.friction_terms import FRICTION_FAMILIES, TERMS
from ...models.joint import SYMBOLS_BY_NAME

MINUS_SIGN = "\N{MINUS SIGN}"

_NEGATIVE_ZERO_PATTERN = re.compile(r"(?<![\w.^)-])[-\N{MINUS SIGN}](0(?:\.0+)?)(?!\w|\.\d)")
"""A number that was rounded to zero, with a minus sign."""

SUPERSCRIPT_DIGITS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
"""Translation of the digits of an exponent."""

PARAMETER_LABELS: Mapping[str, str] = MappingProxyType(
    {
        "inertia": "Inertia",
        "gravity": "Gravity, sine",
        "gravity_cosine": "Gravity, cosine",
        "parallel_stiffness": "Parallel spring",
        "offset": "Offset",
        **{term.name: term.words for term in TERMS},
        "drive_constant": "Drive constant",
    }
)

FAMILIES: Mapping[str, str] = MappingProxyType({family.name: family.words for family in FRICTION_FAMILIES})

METHODS: Mapping[str, str] = MappingProxyType(
    {
        "ls": "least squares",
        "wls": "weighted least squares",
        "irls": "robust least squares",
        "iv": "instrumental variables",
        "didim": "DIDIM",
        "output_error": "output error",
    }
)

MODES: Mapping[str, str] = MappingProxyType({"closed_loop": "closed loop", "openloop": "open loop"})

EFFORT_NAMES: Mapping[str, str] = MappingProxyType({"N*m": "Torque", "N": "Force", "A": "Current", "V": "Voltage"})


@dataclass(frozen=True)
class Reading:
    """Presentation of a motion."""

    scale: float  # number of `position` units in one SI unit
    position: str  # unit of position, as shown

    @property
    def velocity(self) -> str:
        """Unit of velocity, as shown."""
        return f"{self.position}/s"


MOTION_READINGS: Mapping[str, Reading] = MappingProxyType(
    {"rotary": Reading(180.0 / math.pi, "deg"), "prismatic": Reading(1e3, "mm")}
)


def unit_text(unit: str) -> str:
    """Return a unit with its typography: ``kg*m^2`` becomes ``kg·m²``, and the unit 1 an empty text."""
    if unit == "1":
        return ""
    head, *powers = unit.split("^")
    text = head
    for part in powers:
        digits = len(part) - len(part.lstrip("-0123456789"))
        text += part[:digits].translate(SUPERSCRIPT_DIGITS) + part[digits:]
    return text.replace("*", "·")


def decimals_of(uncertainty: float) -> int | None:
    """Return the decimals that two significant digits of `uncertainty` need (negative for tens); None without one."""
    if not math.isfinite(uncertainty) or uncertainty <= 0.0:
        return None
    # The uncertainty is rounded as text first, so that 0.0996 counts as 0.10.
    return 1 - int(f"{uncertainty:.1e}".split("e")[1])


def number(value: float, uncertainty: float = math.nan, digits: int = 4) -> str:
    """Return `value` rounded by its `uncertainty`, or to `digits` significant digits without one.

    Parameters
    ----------
    value : float
    uncertainty : float
        Same unit as `value`; its second significant digit is the last one shown.
    digits : int
        Significant digits where there is no uncertainty.

    Returns
    -------
    str
        With a true minus sign; powers of ten where decimals would not fit.

    Examples
    --------
    >>> number(95.10894, 0.1085)
    '95.11'
    """
    if not math.isfinite(value):
        return "–" if math.isnan(value) else ("∞" if value > 0 else f"{MINUS_SIGN}∞")
    decimals = decimals_of(uncertainty)
    if decimals is None:
        decimals = digits - 1 - (int(f"{value:.{digits - 1}e}".split("e")[1]) if value else 0)
    decimals = min(decimals, 15)
    rounded = round(value, decimals)
    fits = decimals <= 6 or (decimals <= 9 and abs(rounded) >= 0.1)
    if rounded != 0.0 and (not fits or abs(rounded) >= 1e6):
        exponent = int(f"{rounded:e}".split("e")[1])
        mantissa = f"{rounded / 10.0**exponent:.{max(decimals + exponent, 0)}f}"
        text = f"{mantissa}×10{str(exponent).translate(SUPERSCRIPT_DIGITS)}"
    else:
        text = f"{0.0 if rounded == 0.0 else rounded:.{max(min(decimals, 6 if rounded == 0.0 else 9), 0)}f}"
    return text.replace("-", MINUS_SIGN)


def interval(low: float, high: float, uncertainty: float) -> str:
    """Return the text "`low` to `high`" with the decimals that their `uncertainty` allows."""
    return f"{number(low, uncertainty)} to {number(high, uncertainty)}"


def effort_label(unit: str) -> str:
    """Return what an axis calls an effort: its name and its unit, such as "Voltage (V)"."""
    return f"{EFFORT_NAMES.get(unit, 'Effort')} ({unit_text(unit)})"


def parameter_interval(parameter: Parameter, level: float) -> str:
    """Return a parameter's interval as text, cut at a physical bound; a value that was chosen has none."""
    if parameter.standard_error == 0.0:
        return "–"
    if parameter.refused:
        return "not identifiable"
    low, high = parameter.interval(level)
    symbol = SYMBOLS_BY_NAME.get(parameter.name)
    if parameter.at_bound and symbol is not None:
        low, high = max(low, symbol.lower), min(high, symbol.upper)
    return interval(low, high, parameter.standard_error)


def interval_text(parameter: Parameter, level: float) -> str:
    """Return a parameter's value, the half-width of its interval at a confidence `level`, and its unit."""
    value, error, unit = parameter.value, parameter.standard_error, unit_text(parameter.unit)
    low, high = parameter.interval(level)
    half = f" ± {number(0.5 * (high - low), error)}" if error > 0.0 else ""
    return f"{number(value, error)}{half} {unit}".rstrip()


def value_and_half_interval(parameter: Parameter, level: float, *, refused: str = "") -> str:
    """Return a parameter's value with half its interval, or with the remark that the value is not identifiable.

    `refused` is the reason for which another estimate of the same parameter was refused; "" if it was not.
    """
    if parameter.refused or refused:
        return f"{number(parameter.value, parameter.standard_error)}, not identifiable"
    low, high = parameter.interval(level)
    half = number(0.5 * (high - low), parameter.standard_error)
    return f"{number(parameter.value, parameter.standard_error)} ± {half}"


def parameter_note(parameter: Parameter, level: float) -> str:
    """Return a short warning about a parameter for the cell of its interval; "" if there is none."""
    low, high = parameter.interval(level)
    if parameter.undetermined:
        return "undetermined"
    if parameter.at_bound:
        return "undetermined: on a bound" if parameter.refused else "at its bound"
    if parameter.standard_error == 0.0:
        return "not fitted"
    if parameter.refused:
        return parameter.refused  # the interval itself says that it is refused
    if parameter.identifiable:
        return parameter.doubt
    return "may be zero" if low <= 0.0 <= high else "unclear"


def relative_sd(parameter: Parameter) -> str:
    """Return the standard error as a percentage of the value; a dash if the value is at a bound or almost zero."""
    if parameter.at_bound or parameter.standard_error == 0.0:
        return "–"
    return "> 1000" if parameter.relative_sd > 1000.0 else percent(parameter.relative_sd)


def percent(value: float) -> str:
    """Return a percentage as text: three significant digits above 0.1 %, two below, without the percent sign."""
    if not math.isfinite(value):
        return number(value)
    if value == 0.0:
        return "0"
    if abs(value) < 1e-4:
        return "< 0.0001"
    if abs(value) >= 100.0:
        return number(value, digits=3)
    return number(value, digits=3 if abs(value) >= 0.1 else 2)


_COLUMN_PATTERN = r"\b(?=\w*_)(?=\w*[A-Z])\w+"
"""Name of a column: the program's own names have no capital letter."""

_NUMBERED_PATTERN = r"\b(?=\w*[a-z]_)(?=\w*\d)\w+"

_FILE_PATTERN = r"\S+\.(?:csv|tsv|txt|json|mat|c3d|edf|bdf|xdf|toml|urdf)\b"


VALUE_END = "\uf8f2"
"""Hidden character behind the digits of a value that a page shows under an id."""

_UNIT_PATTERN = (
    r"(?:%|(?:deg|rad|mm|cm|m|min|s|ms|Hz|kHz|kg|g|N|A|mA|V|mV|W|J|K|rpm)[²³]?"
    r"(?:[·*/](?:deg|rad|mm|m|s|kg|A|V|N)[²³]?)*)(?![\w·*/²³°])"
)
"""Symbol of a unit behind a number."""

_NUMBER_BEFORE_UNIT = rf"(`[^`]*`|\"[^\"]*\")|(?<=[\d{VALUE_END}]) (?={_UNIT_PATTERN})"
"""Text to be copied, or the space between a number and its unit, at which no line may break."""


def typeset_sentence(text: str) -> str:
    """Return a sentence with its typography: capital first letter, minus signs, units, R², names in words.

    Names of files, of columns with a capital letter and of recordings with a number, and symbols, stay unchanged.
    """
    own = re.search(r"[\d']|\.[a-z]", text.split(" ", 1)[0])
    for method, words in METHODS.items():
        text = text.replace(f"'{method}'", words)
    for name in (n for n in PARAMETER_LABELS if "_" in n):
        text = re.sub(rf"\b{name}\b", name.replace("_positive", " +").replace("_negative", f" {MINUS_SIGN}"), text)
    # A key with a value, such as lever_arm=0.3 m, is there to be copied.
    kept = rf"`[^`]*`|{_FILE_PATTERN}|{_COLUMN_PATTERN}|{_NUMBERED_PATTERN}|\b\w+(?= ?=)"
    text = re.sub(rf"({kept})|(?<=[a-z])_(?=[a-z])", lambda found: found[1] or " ", text)
    text = re.sub(r"\bR2\b", "R²", typeset_quantities(text))
    text = re.sub(_NUMBER_BEFORE_UNIT, lambda found: found[1] or "\N{NO-BREAK SPACE}", text)
    return text if own else capitalised(text)


def name_words(name: str) -> str:
    """Return a name of a study, such as a condition's, in words, as sentences of a page have it.

    >>> name_words("force_sensor"), name_words("P3_speed_1")
    ('force sensor', 'P3_speed_1')
    """
    return name if re.fullmatch(_COLUMN_PATTERN, name) else re.sub(r"(?<=[a-z])_(?=[a-z])", " ", name)


def capitalised(text: str) -> str:
    """Return a text with a capital first letter; all others stay."""
    return text[:1].upper() + text[1:]


def typeset_quantities(text: str) -> str:
    """Return a sentence with the typography of its units, N·m or kg·m², and of its minus signs.

    Names of files, options such as ``-v``, and quoted values, which are to be copied, stay unchanged.
    """
    text = re.sub(r"(?<=[A-Za-z])\*(?=[A-Za-z])", "·", without_negative_zero(text))
    text = re.sub(r"(?<=[a-z])\^2\b", "²", text)
    return re.sub(r"(?<![\w^\"-])-(?=\.?\d)", MINUS_SIGN, text)


def parameter_label(name: str, unit: str = "") -> str:
    """Return a parameter's name in words; the inertia of a joint that slides, in kg, is its mass."""
    if name == "inertia" and unit == "kg":
        return "Mass"
    return PARAMETER_LABELS.get(name, name.replace("_", " "))


def without_negative_zero(text: str) -> str:
    """Return a text in which no number that was rounded to zero has a minus sign."""
    return _NEGATIVE_ZERO_PATTERN.sub(r"\1", text)


def cell_text(value: str | float | int | None) -> str:
    """Return a table's cell as text: three digits of a figure, all digits of a count, a dash for None."""
    if isinstance(value, str):
        return "held out" if value == "heldout" else without_negative_zero(value)
    if value is None:
        return "–"
    return str(value) if isinstance(value, int) else number(value, digits=3)


def typeset_cell(value: str | float | int | None) -> str:
    """Return a cell of a page's table as text, with minus signs before numbers."""
    return re.sub(r"(?<!\S)-(?=\d)", MINUS_SIGN, cell_text(value))
