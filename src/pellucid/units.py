"""Convert quantities with units into SI numbers. The rest of the package knows SI units only.

A unit is plain text: ``N*m``, ``kg*m^2``, ``N*m*s/rad``, ``deg``, ``mA``, ``%``, ``1``. An angle is a dimension of its
own, so that a position in degrees cannot pass for one in metres, nor ``rad/s`` for ``Hz``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from ._errors import StudyError

# Pint's own definitions have 1,000 units. There rad is a plain number, and a typo easily names another unit.
_PINT_DEFINITIONS = """
mega- = 1e6 = M-
kilo- = 1e3 = k-
deca- = 10 = da-
deci- = 1e-1 = d-
centi- = 1e-2 = c-
milli- = 1e-3 = m-
micro- = 1e-6 = µ- = μ- = u-
nano- = 1e-9 = n-
second = [time] = s = sec
meter = [length] = m = metre
kilogram = [mass] = kg
ampere = [current] = A
radian = [angle] = rad
kelvin = [temperature] = K
count = [count] = _ = counts
gram = 1e-3 * kilogram = g
minute = 60 * second = min
hour = 3600 * second = h
day = 24 * hour = d
hertz = 1 / second = Hz
degree = 0.017453292519943295 * radian = deg = degrees = °
gon = 0.015707963267948967 * radian
arcminute = 0.0002908882086657216 * radian = arcmin
arcsecond = 4.84813681109536e-06 * radian = arcsec
turn = 6.283185307179586 * radian = _ = rev = turns
rpm = turn / minute
newton = kilogram * meter / second ** 2 = N
newton_meter = newton * meter = Nm
joule = newton * meter = J
watt = joule / second = W
volt = watt / ampere = V
ohm = volt / ampere = _ = Ohm = Ω
henry = volt * second / ampere = H
pascal = newton / meter ** 2 = Pa
tesla = volt * second / meter ** 2 = T
inch = 0.0254 * meter
foot = 0.3048 * meter
pound_force = 4.4482216152605 * newton = lbf
ounce_force = 0.27801385095378125 * newton = ozf
kilogram_force = 9.80665 * newton = kgf
standard_gravity = 9.80665 * meter / second ** 2 = g0
degree_Celsius = kelvin; offset: 273.15 = degC = °C = celsius
degree_Fahrenheit = 0.5555555555555556 * kelvin; offset: 255.3722222222222 = degF = °F
percent = 0.01 = %
permille = 0.001
maximal_contraction = [effort] = MVC
percent_MVC = 0.01 * maximal_contraction
"""

# SI unit in which values of each dimension are shown. N*m stands before J, because torques are more common here.
_SI_TEXTS = (
    "1", "s", "Hz", "m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "kg", "kg*m^2", "N", "N*m", "W", "A", "V", "ohm",
    "H", "Pa", "T", "K", "count", "N*s/m", "N*m*s/rad", "N*m/rad", "N/m", "N*m/A", "N*m/V", "N/A", "N/V",
    "V*s/rad", "V*s^2/rad", "V*s^2/m", "A*s/rad", "A*s^2/rad", "A*s^2/m", "MVC",
)  # fmt: skip

# Factor and SI text of units that need no Pint, which takes a third of a second to load.
_COMMON_UNITS: Mapping[str, tuple[float, str]] = {
    **{text: (1.0, text) for text in _SI_TEXTS},
    "deg": (math.pi / 180.0, "rad"), "deg/s": (math.pi / 180.0, "rad/s"), "ms": (1e-3, "s"), "mm": (1e-3, "m"),
    "mV": (1e-3, "V"), "mA": (1e-3, "A"), "%": (1e-2, "1"),
}  # fmt: skip

# Texts that Pint may parse. Pint itself would also accept comments, and powers that take endless time.
_UNIT_PATTERN = re.compile(r"(?!.*(?:\d{3}|[\d)]\s*(?:\^|\*\*)))[\w°%^*/(). -]{1,60}")

_QUANTITY_PATTERN = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?inf|nan)(.*)", re.DOTALL)


@dataclass(frozen=True)
class Coordinate:
    """The coordinate along which a joint moves, an angle or a length, and its presentation."""

    unit: str  # SI unit
    shown: str  # unit in tables
    factor: float  # number of `shown` units in one `unit`
    effort: str  # SI unit of the effort that moves it
    radian: float  # value that replaces one radian in rules about angles [unit]
    ways: Mapping[str, str]  # word for each direction, "up" and "down"


COORDINATES_BY_UNIT: Mapping[str, Coordinate] = {
    "rad": Coordinate("rad", "deg", math.degrees(1.0), "N*m", 1.0, {"up": "upwards", "down": "downwards"}),
    "m": Coordinate("m", "mm", 1e3, "N", 0.1, {"up": "forwards", "down": "backwards"}),
}
"""Coordinates by their SI unit."""

MIN_MAGNITUDE = 1e-15
"""Smallest accepted magnitude of a quantity that is not 0, in SI."""

MAX_MAGNITUDE = 1e15
"""Largest accepted magnitude of a quantity, in SI."""


ROUNDED_UNITS = ("m", "rad")
"""Lengths and angles below `MIN_MAGNITUDE` are 0: a program that computed 1.9e-17 m has rounded."""


def parse_quantity(text: str | float, expected: str | tuple[str, ...] | None, where: str) -> float:
    """Read a quantity such as ``"0.060 N*m/A"`` into SI.

    Parameters
    ----------
    text : str or float
        Number and unit. A bare number is accepted only if `expected` is ``"1"``.
    expected : str, tuple of str, or None
        SI unit of the dimension that the quantity must have; a tuple of alternatives; None for any unit.
    where : str
        Place of the quantity, for the message: ``"[rig.drive] torque_constant"``; may be empty.

    Returns
    -------
    float
        Value in SI.

    Raises
    ------
    StudyError
        If there is no number, no unit, an unknown unit, or a unit of another dimension.

    Examples
    --------
    >>> parse_quantity("500 mA", expected="A", where="limit")
    0.5
    """
    if isinstance(text, bool) or not isinstance(text, (str, int, float)):
        raise StudyError(f"{_at(where)}found {text!r}, expected a quantity such as {_example(expected)}")
    if not isinstance(text, str):
        if expected == "1":
            return float(text)
        raise StudyError(f"{_at(where)}found {text!r} without a unit, expected e.g. {_example(expected, text)}")
    match = _QUANTITY_PATTERN.fullmatch(text)
    if match is None:
        raise StudyError(f'{_at(where)}found "{text}", which starts with no number, expected e.g. {_example(expected)}')
    number, unit = float(match[1]), match[2].strip()
    if not math.isfinite(number):
        raise StudyError(f'{_at(where)}found "{text}", expected a finite number such as {_example(expected)}')
    if not unit and expected != "1":
        raise StudyError(f'{_at(where)}found "{text}" without a unit, expected e.g. {_example(expected, match[1])}')
    factor, offset = _factor(unit or "1", expected, where)
    value = number * factor + offset
    if 0.0 < abs(value) < MIN_MAGNITUDE and si_text(unit or "1") in ROUNDED_UNITS:
        return 0.0
    if value and not MIN_MAGNITUDE <= abs(value) <= MAX_MAGNITUDE:
        raise StudyError(
            f'{_at(where)}found "{text}", expected 0 or from {MIN_MAGNITUDE:g} to {MAX_MAGNITUDE:g} in SI, as no '
            "machine has more"
        )
    return value


def to_si_factor(unit: str, expected: str | tuple[str, ...] | None, where: str = "unit") -> tuple[float, float]:
    """Return the factor and offset that convert values in `unit` to SI: ``si = value * factor + offset``."""
    return _factor(unit, expected, where)


def contradicts_unit(text: str, unit: str) -> bool:
    """Whether `text` is a known unit that means another one than `unit`; ``"Nm"`` does not contradict ``"N*m"``."""
    if text == unit:
        return False
    try:
        return si_text(text) != si_text(unit) or to_si_factor(text, None) != to_si_factor(unit, None)
    except StudyError:
        return False  # an abbreviation that only its writer knows


def si_text(unit: str) -> str:
    """Return the SI unit for values in `unit`, as plain text: ``si_text("mN*m")`` is ``"N*m"``."""
    return _si_text(unit)


@lru_cache(maxsize=1024)
def _si_text(unit: str) -> str:
    if unit in _COMMON_UNITS:
        return _COMMON_UNITS[unit][1]
    dimension = _parse(unit, "unit")[2]
    for text in _SI_TEXTS:
        if _parse(text, "unit")[2] == dimension:
            return text
    powers = base_powers(unit)
    up = [symbol + (f"^{p:g}" if p != 1 else "") for symbol, p in powers.items() if p > 0]
    down = [symbol + (f"^{-p:g}" if p != -1 else "") for symbol, p in powers.items() if p < 0]
    return "/".join(["*".join(up) or "1", *down])


_BASE_UNITS: Mapping[str, str] = {
    "[mass]": "kg", "[length]": "m", "[count]": "count", "[angle]": "rad", "[current]": "A", "[temperature]": "K",
    "[effort]": "MVC", "[time]": "s",
}  # fmt: skip


def base_powers(unit: str) -> dict[str, float]:
    """Return the power of each base unit in `unit`: ``base_powers("N*m")`` is ``{"kg": 1, "m": 2, "s": -2}``."""
    dimension = dict(_parse(unit, "unit")[2])
    return {symbol: dimension[name] for name, symbol in _BASE_UNITS.items() if name in dimension}


def _at(where: str) -> str:
    return f"{where}: " if where else ""


def _example(expected, number="1.0") -> str:
    unit = expected[0] if isinstance(expected, tuple) else expected or "N*m"
    return f'"{number}"' if unit == "1" else f'"{number} {unit}"'


@lru_cache(maxsize=4096)
def _factor(unit: str, expected: str | tuple[str, ...] | None, where: str) -> tuple[float, float]:
    wanted = () if expected is None else (expected,) if isinstance(expected, str) else expected
    if unit in _COMMON_UNITS and (not wanted or _COMMON_UNITS[unit][1] in wanted):
        return _COMMON_UNITS[unit][0], 0.0
    if unit == "g" and "m/s^2" in wanted:
        unit = "g0"  # An accelerometer counts in gravities, never in grams
    factor, offset, dimension = _parse(unit, where)
    if wanted and all(_parse(w, where)[2] != dimension for w in wanted):
        hint = ""
        if dict(dimension).get("[count]"):
            hint = "; counts need a scale, and the unit they have after it"
        names = " or ".join(f'"{w}"' for w in wanted)
        raise StudyError(f'{_at(where)}found the unit "{unit}", expected {names}{hint}')
    return factor, offset


@lru_cache(maxsize=1)
def _registry():
    import pint

    registry: pint.UnitRegistry = pint.UnitRegistry(None, on_redefinition="raise", autoconvert_offset_to_baseunit=True)
    registry.load_definitions(_PINT_DEFINITIONS.strip().splitlines())
    return registry


@lru_cache(maxsize=1024)
def _parse(unit: str, where: str) -> tuple[float, float, frozenset]:
    if not isinstance(unit, str) or not unit.strip():
        raise StudyError(f'{_at(where)}no unit found, expected one such as "rad", "N*m" or "1"')
    if unit.strip() == "1":
        return 1.0, 0.0, frozenset()
    registry = _registry()
    try:
        if _UNIT_PATTERN.fullmatch(unit) is None:
            raise ValueError(unit)
        # Pint reads a leading 1 as a number, and refuses numbers in units.
        text = re.sub(r"^\s*1\s*/", "dimensionless/", unit).replace("%MVC", "percent_MVC")
        parsed = registry.parse_units(text)
        zero, one = (registry.Quantity(v, parsed).to_base_units().magnitude for v in (0.0, 1.0))
        dimension = frozenset((k, float(p)) for k, p in parsed.dimensionality.items())
    except Exception as error:  # Pint raises its own errors, tokenizer errors and attribute errors
        raise StudyError(f'{_at(where)}found the unknown unit "{unit}"{_nearest(unit)}') from error
    return one - zero, zero, dimension


def _nearest(unit: str) -> str:
    import difflib

    others = ["deg", "deg/s", "rpm", "mA", "mV", "%", "%MVC", "ms", "mm", "cm", "mN*m", "kHz", "degC", "turn"]
    known = [*_SI_TEXTS, *others]
    close = difflib.get_close_matches(unit, known, 1, 0.5) or [
        k for k in known if k.lower() == re.sub(r"[\s.·]+", "*", unit).lower()
    ]
    return f'; the nearest known one is "{close[0]}"' if close else ', expected one such as "rad", "N*m" or "1"'
