"""Read units as people write them in headers, and return them as study.toml writes them.

This is the only place that knows spellings of units. A header may state its unit in brackets, after a comma, a slash or
an underscore, or as its last word.
"""

from __future__ import annotations

import re
from functools import lru_cache

from ..units import to_si_factor

_UNITS_BY_TEXT = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sekunden": "s", "ms": "ms", "msec": "ms",
    "msecs": "ms", "millis": "ms", "millisecond": "ms", "milliseconds": "ms", "us": "us", "usec": "us", "usecs": "us",
    "micros": "us", "microsecond": "us", "microseconds": "us", "ns": "ns", "nsec": "ns", "nsecs": "ns",
    "nanosec": "ns", "nanoseconds": "ns", "min": "min", "minutes": "min", "h": "h", "hr": "h", "hours": "h",
    "days": "d", "day": "d",
    "deg": "deg", "degs": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "grad": "deg",
    "rad": "rad", "rads": "rad", "radian": "rad", "radians": "rad", "mrad": "mrad", "urad": "urad",
    "turn": "turn", "turns": "turn", "rev": "turn", "revs": "turn", "revolutions": "turn",
    "dps": "deg/s", "degps": "deg/s", "radps": "rad/s", "rps": "turn/s", "rpm": "rpm", "u/min": "rpm", "r/min": "rpm",
    "nm": "N*m", "nmm": "N*mm", "ncm": "cN*m", "mnm": "mN*m", "knm": "kN*m", "unm": "uN*m", "cnm": "cN*m",
    "newton meter": "N*m", "newton meters": "N*m", "newton-meters": "N*m", "newton metre": "N*m",
    "newton metres": "N*m", "newton millimeters": "N*mm", "newton millimetres": "N*mm",
    "newtonmeter": "N*m", "newtonmeters": "N*m", "newtonmetre": "N*m", "newtonmetres": "N*m",
    "newtonmillimeters": "N*mm", "newtonmillimetres": "N*mm", "millinewtonmeters": "mN*m",
    "n": "N", "newton": "N", "newtons": "N", "kn": "kN", "mn": "mN", "kilonewtons": "kN", "millinewtons": "mN",
    "lb": "lbf", "lbs": "lbf", "lbf": "lbf", "kgf": "kgf", "kp": "kgf", "oz": "ozf", "ozf": "ozf",
    "a": "A", "amp": "A", "amps": "A", "ampere": "A", "amperes": "A", "ma": "mA", "milliamps": "mA",
    "milliampere": "mA", "milliamperes": "mA", "ua": "uA", "ka": "kA",
    "v": "V", "volt": "V", "volts": "V", "mv": "mV", "millivolt": "mV", "millivolts": "mV", "uv": "uV",
    "microvolt": "uV", "microvolts": "uV", "nv": "nV", "kv": "kV",
    "m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "mm": "mm", "millimeters": "mm",
    "millimetres": "mm", "cm": "cm", "centimeters": "cm", "centimetres": "cm", "um": "um", "km": "km",
    "in": "inch", "inch": "inch", "inches": "inch", "ft": "foot", "feet": "foot", "foot": "foot",
    "mps": "m/s", "mps2": "m/s^2", "g": "g0", "g0": "g0", "mg": "mg0", "t": "T", "ut": "uT", "mt": "mT",
    "hz": "Hz", "khz": "kHz", "%": "%", "percent": "%", "pct": "%", "%mvc": "%MVC", "% mvc": "%MVC", "mvc": "MVC",
    "‰": "permille", "permille": "permille", "per mille": "permille", "per thousand": "permille",
    "per mil": "permille", "gon": "gon", "1/min": "rpm", "min-1": "rpm", "pulse": "counts",
    "pulses": "counts", "puls": "counts", "pls": "counts", "increments": "counts", "steps": "counts", "bit": "counts",
    "arms": "A", "a rms": "A", "a_rms": "A", "a (rms)": "A", "ma rms": "mA", "apk": "A", "a pk": "A", "a peak": "A",
    "%mvic": "%MVC", "percent mvc": "%MVC", "counts": "counts", "count": "counts", "cts": "counts", "qc": "counts",
    "inc": "counts", "incr": "counts", "increment": "counts", "cnt": "counts", "cnts": "counts", "lu": "counts",
    "puu": "counts",
    "ticks": "counts", "tick": "counts", "lsb": "counts", "adc": "counts", "dots": "counts",
    "px": "counts", "pixels": "counts", "degc": "degC", "°c": "degC", "celsius": "degC", "degf": "degF", "°f": "degF",
    "fahrenheit": "degF", "k": "K", "kelvin": "K", "w": "W", "watt": "W", "watts": "W", "kw": "kW", "mw": "mW",
    "j": "J", "joule": "J", "joules": "J", "kg": "kg", "pa": "Pa", "kpa": "kPa", "mpa": "MPa", "ohm": "ohm",
    "ohms": "ohm", "Ω": "ohm", "ω": "ohm", "1": "1", "-": "1", "bool": "1", "a.u.": "1", "au": "1", "unitless": "1",
    "dimensionless": "1", "n m": "N*m", "prozent": "%", "promille": "permille", "dnm": "dN*m", "danm": "daN*m",
    "grados": "deg", "gradi": "deg", "graus": "deg", "degrés": "deg", "graden": "deg", "radianes": "rad",
    "radianti": "rad", "segundos": "s", "secondes": "s", "secondi": "s", "vueltas": "turn", "giri": "turn",
    "tours": "turn", "umdrehungen": "turn", "amperios": "A", "voltios": "V",
    "cdeg": "cdeg", "mdeg": "mdeg", "ddeg": "ddeg", "udeg": "udeg", "centideg": "cdeg", "millideg": "mdeg",
    "decideg": "ddeg", "microdeg": "udeg", "millidegrees": "mdeg", "centidegrees": "cdeg", "decidegrees": "ddeg",
    "millirad": "mrad", "microrad": "urad", "arcmin": "arcmin", "arcsec": "arcsec",
    "in_lb": "lbf*inch", "in_lbs": "lbf*inch", "inlb": "lbf*inch", "inlbs": "lbf*inch", "inlbf": "lbf*inch",
    "lb_in": "lbf*inch", "lbf_in": "lbf*inch", "lbin": "lbf*inch", "lbfin": "lbf*inch", "oz_in": "ozf*inch",
    "ozin": "ozf*inch", "ozfin": "ozf*inch", "inoz": "ozf*inch", "in_oz": "ozf*inch", "ft_lb": "lbf*foot",
    "ft_lbs": "lbf*foot", "ftlb": "lbf*foot", "ftlbs": "lbf*foot", "ftlbf": "lbf*foot", "lb_ft": "lbf*foot",
    "lbf_ft": "lbf*foot", "lbft": "lbf*foot", "lbfft": "lbf*foot", "kg_cm": "kgf*cm", "kgcm": "kgf*cm",
    "kgf_cm": "kgf*cm", "kgfcm": "kgf*cm", "kgf_m": "kgf*m", "kgfm": "kgf*m",
    "度": "deg", "도": "deg", "град": "deg", "弧度": "rad", "라디안": "rad", "рад": "rad", "转": "turn", "회전": "turn",
    "秒": "s", "초": "s", "сек": "s", "с": "s", "毫秒": "ms", "밀리초": "ms", "мс": "ms", "度/s": "deg/s",
    "度/秒": "deg/s", "도/s": "deg/s", "도/초": "deg/s", "рад/с": "rad/s", "转/分": "rpm", "об/мин": "rpm",
    "牛米": "N*m", "牛*米": "N*m", "н*м": "N*m", "нм": "N*m", "牛": "N", "安": "A", "毫安": "mA", "伏": "V",
}  # fmt: skip
"""Single units, and compound ones of one word, as study.toml writes them, by how headers write them in lower case.

Siemens' LU and Delta's PUU are lengths that the machine's builder sets: counts, of which a turn has some number.
"""

_CASE_MATTERS = {
    "A": "A", "a": "", "N": "N", "n": "", "V": "V", "v": "", "T": "T", "t": "", "C": "", "c": "", "K": "", "k": "",
    "W": "W", "w": "", "J": "J", "j": "", "H": "", "h": "",
}  # fmt: skip
"""Units of one letter. In the other case the letter is a name, such as t for time."""

_BRACKETED_LETTERS = {"a": "A", "n": "N", "v": "V", "C": "degC", "c": "degC", "K": "K", "w": "W", "h": "h", "H": "h"}
"""Units of one letter that are certain within brackets only."""

_EXACT_UNITS = {
    "mN": "mN", "cN": "cN", "dN": "dN", "daN": "daN", "MPa": "MPa", "MHz": "MHz", "mA": "mA", "MA": "", "mV": "mV",
    "MV": "", "mW": "mW",
}  # fmt: skip
"""Units whose case decides their size."""

_NEWTON_METRES = re.compile(r"(da|[numckdM]?)N(m|mm|cm)")
"""Newton metres written as one word."""

_FORCES_OF_MASSES = {"kg*cm": "kgf*cm", "kg*m": "kgf*m", "kg*mm": "kgf*mm", "cm*kg": "kgf*cm", "m*kg": "kgf*m"}
"""Torques of servos that are written with the mass whose weight is meant."""

_UNIT_PART = re.compile(r"([A-Za-z%°Ω]+)(?:(?:\^|\*\*)?\(?([-+]?\d)\)?)?")
"""One unit of a compound one, with its exponent."""

_UNIT_SIGN = re.compile(r"\s*(/|\bper\b|[*.-])\s*|\s+")
"""Signs between the units of a compound one."""

_PLAIN_SIGNS = str.maketrans({
    "µ": "u", "μ": "u", "º": "°", "˚": "°", "·": "*", "⋅": "*", "∙": "*", "•": "*", "・": "*", "･": "*", "×": "*",
    "‐": "-", "‑": "-",
    "–": "-", "−": "-", "⁻": "-", "¹": "1", "²": "2", "³": "3", "⁄": "/", "∕": "/", "\u00a0": " ", "\u202f": " ",
    "\u2009": " ", "\ufeff": "",
})  # fmt: skip
"""Signs that programs write for the plain ones."""

MAX_UNIT_PLACE = 200
"""A unit stands within this many last characters of a name. Longer names would make searches for it slow."""

_BRACKETED_TEXT = re.compile(r"\s*[\[({]\s*([^\[\](){}]*(?:\([^()]*\)[^\[\](){}]*)?)\s*[\])}]\s*")

_WORDS_WITH_LETTER = {
    "s": {"time", "t", "stamp", "timestamp", "clock", "elapsed", "zeit"},
    "m": {"position", "pos", "x", "y", "z", "displacement", "disp", "length", "height", "radius", "distance", "stroke",
        "travel", "q"},
    "g": {"acc", "acceleration", "accel", "ax", "ay", "az", "x", "y", "z"},
    "N": {"force", "load", "kraft", "grf", "fx", "fy", "fz", "thrust", "cell", "loadcell", "tension", "f"},
    "A": {"current", "cur", "curr", "i", "iq", "strom", "motor"},
    "V": {"voltage", "volt", "spannung", "u", "vin", "bus", "battery", "supply", "emg", "vbus"},
}  # fmt: skip
"""Last words of names after which a single letter is a unit; elsewhere it is part of the name."""

_LETTERS_AFTER_UNDERSCORE = "VAN"
"""Capitals that are units after an underscore, whatever the word before."""

_UNIT_WORDS = frozenset({
    "deg", "degs", "degree", "degrees", "rad", "rads", "radian", "radians", "mrad", "turn", "turns", "revs", "rpm",
    "rps", "dps", "degps", "radps", "ms", "us", "ns", "sec", "secs", "seconds", "msec", "usec", "nsec", "millis",
    "micros", "ma", "ua", "milliamps", "amps", "uv", "mv", "nv", "kv", "microvolts", "millivolts", "volts", "mm", "cm",
    "um", "mps", "mps2", "nm", "nmm", "ncm", "mnm", "cnm", "knm", "unm", "n.m", "n.mm", "mn.m", "kn", "mn", "newtons",
    "newtonmeters", "lbf", "lbs", "kgf", "counts", "ticks", "pct", "percent", "hz", "khz", "degc", "degf", "celsius",
    "watts", "kw", "mw", "mvc", "kpa", "dnm", "danm", "permille", "promille", "prozent", "cdeg", "mdeg", "ddeg",
    "udeg", "centideg", "millideg", "decideg", "microdeg", "millidegrees", "centidegrees", "decidegrees", "millirad",
    "microrad", "arcmin", "arcsec", "inlb", "inlbs", "inlbf", "in_lb", "in_lbs", "lb_in", "lbf_in", "lbin", "lbfin",
    "oz_in", "ozin", "ozfin", "inoz", "in_oz", "ft_lb", "ft_lbs", "ftlb", "ftlbs", "ftlbf", "lb_ft", "lbf_ft", "lbft",
    "lbfft", "kg_cm", "kgcm", "kgf_cm", "kgfcm", "kgf_m", "kgfm",
})  # fmt: skip
"""Words, folded, that are a unit at the end of a name; others, such as min, count and amp, are more often the name."""

_UNIT_AT_CAPITAL = re.compile(
    r"(?<=[a-z]{2})(mNm|kNm|cNm|dNm|Nmm|Ncm|Nm)$|(?<=[a-z])(DegPerSec|RadPerSec|Degrees|Deg|Radians|Rad|RPM|Rpm|mA|mV|uV|Ms|Millis)$"
)
"""Units at the end of a name without a mark before them, as in jointAngleDeg."""

_COMPOUND_PARTS = frozenset(
    {"N", "mN", "kN", "m", "mm", "cm", "s", "A", "mA", "V", "rad", "deg", "Nm", "kg", "s2", "s^2", "min", "rev", "°"}
)
"""Parts of compound units at the end of a name."""

_SUFFIX_TEXTS = {
    "rads": "rad/s", "degs": "deg/s", "ms2": "m/s^2",
}
"""Units, folded, that mean something else at the end of a name."""

_ANGLE_WORDS = frozenset({
    "angle", "ang", "position", "pos", "q", "theta", "phi", "rotation", "enc", "encoder", "winkel", "lage", "stellung",
})  # fmt: skip
"""Last words of names after which "gon" and "grad" are units; elsewhere a goniometer, or a gradient."""

_UNIT_WITHIN = re.compile(
    r"[_ .:/-](mNm|kNm|Nmm|Ncm|Nm|NM|deg|rad|rpm|RPM|dps|mA|mV|uV)(?=\d*(?:[_ .:-]|$))"
)
"""Units that stand for nothing else wherever they stand behind a mark, as in torque_Nmm_filtered."""

_PER_SECOND = re.compile(
    r"(deg|degs|degrees|rad|rads|radians|m|mm|cm|rev|turn|turns|counts|ticks)_?(?:per|p)?_?s(?:ec(?:ond)?)?(_?\^?2)?",
    re.IGNORECASE,
)
"""Speeds and accelerations as names end in them, where an underscore stands for the sign of division."""

_MAX_SUFFIX_PARTS = 5
"""Units at the end of a name have at most so many parts: Nm_per_rad_per_s."""


_OF_RATED = re.compile(r"\s+(?:of\s+)?(?:the\s+)?(?:motor\s+)?(?:rated|nominal|nenn)\b.{0,20}$", re.IGNORECASE)
"""What a share is of, behind its unit, as in "% of rated torque"."""


_SHARE_OF_RATED = re.compile(
    r"(percent|pct|prozent|permille|promille)_(of_)?(the_)?(motor_)?(rated|nominal|nenn)[a-z_]*"
)
"""A share of a rated effort at the end of a name, as in torque_percent_rated."""

_MULTIPLE = re.compile(r"(?:(?<=[\W_])x|[*×]|(?<=[a-z])X)\s*10+$")
"""End of a name that says a multiple, as in torque_Nm_x10: of the unit, or of the number, is not said."""


@lru_cache(maxsize=4096)
def unit_from_text(text: str) -> str | None:
    """Return a unit as study.toml writes it, None if the text is no unit that is known.

    Examples
    --------
    >>> unit_from_text("Nm"), unit_from_text("N·mm"), unit_from_text("°/s"), unit_from_text("torque")
    ('N*m', 'N*mm', 'deg/s', None)
    """
    bare = re.sub(r"\s+", " ", text.translate(_PLAIN_SIGNS).strip().strip("[]{}").strip())
    if bare.startswith("(") and bare.endswith(")") and bare.count("(") == 1:
        bare = bare[1:-1].strip()
    bare = re.sub(r"^in (?=\S)", "", bare)
    bare = _OF_RATED.sub("", bare) or bare
    if len(bare) == 1 and bare in _CASE_MATTERS:
        return _CASE_MATTERS[bare] or None
    if len(bare) > 40:
        return None
    found = _single_unit(bare) or _compound_unit(bare)
    if found is None:
        return None
    try:
        to_si_factor(found, None)
    except ValueError:
        return None
    return found


_SCALED_SUFFIX = re.compile(r"(?<=[A-Za-z])[_ ](\d+\.\d+ ?[A-Za-z%°µ]+)$")
"""A unit with its number at the end of a name; a whole number may be a joint's."""

_SCALED_UNIT = re.compile(r"\s*(?:x\s*)?(\d+(?:[.,]\d+)?(?:e[-+]?\d+)?|10\^-?\d)\s*[x*·]?\s*(\D.*)", re.IGNORECASE)


def scaled_unit_from_text(text: str) -> tuple[float, str] | None:
    """Return how many of a unit one stored number is, and that unit, as in "0.1 %"; None if the text says neither.

    Examples
    --------
    >>> scaled_unit_from_text("0.1 deg"), scaled_unit_from_text("deg")
    ((0.1, 'deg'), None)
    """
    match = _SCALED_UNIT.fullmatch(text.translate(_PLAIN_SIGNS).strip("[](){} "))
    unit = unit_from_text(match[2]) if match is not None else None
    if match is None or unit is None:
        return None
    number = match[1].replace(",", ".")
    scale = 10.0 ** int(number[3:]) if number.startswith("10^") else float(number)
    return (scale, unit) if 0.0 < scale < 1e9 else None


def _single_unit(text: str) -> str | None:
    if text in _EXACT_UNITS:
        return _EXACT_UNITS[text] or None
    match = _NEWTON_METRES.fullmatch(text)
    if match is not None and match[1] != "M":
        return "cN*m" if text == "Ncm" else f"{match[1]}N*{match[2]}"
    return _UNITS_BY_TEXT.get(text) or _UNITS_BY_TEXT.get(text.casefold())


def _compound_unit(text: str) -> str | None:
    """Return a unit of several, such as mNm/A, rad s^-1 or N-mm; None if a part is unknown."""
    # Nm/(rad/s), and Nm/rad/s, which means the same.
    text = re.sub(r"/\s*\(([^()/]+)/([^()/]+)\)", r"*\2/\1", text)
    text = re.sub(r"/\s*(rad|deg)\s*/\s*(s|sec)$", r"*\2/\1", text, flags=re.IGNORECASE)
    text = re.sub(r"^1\s*/\s*", "/", text)
    up: list[str] = []
    down: list[str] = []
    at, divided = 0, False
    if text.startswith("/"):
        at, divided = 1, True
    while at < len(text):
        part = _UNIT_PART.match(text, at)
        if part is None:
            return None
        unit, power = _single_unit(part[1]), int(part[2] or 1)
        # "Nms" is N*m*s; a count of letters that are no unit is a name.
        if unit is None and part[1] in ("Nms", "nms"):
            unit = "N*m*s"
        if unit is None or unit == "1" or power == 0:
            return None
        side = down if divided ^ (power < 0) else up
        side.append(unit if abs(power) == 1 else f"{unit}^{abs(power)}")
        at = part.end()
        if at == len(text):
            break
        sign = _UNIT_SIGN.match(text, at)
        if sign is None or sign.end() == at:
            return None
        divided, at = (sign[1] or "") in ("/", "per"), sign.end()
        if at == len(text):
            return None
    if not up and not down:
        return None
    if not up:
        return {"min": "rpm", "s": "Hz"}.get("/".join(down))
    made = re.sub(r"/s/s$", "/s^2", "/".join(["*".join(up), *down]))
    if made == "turn/min":
        return "rpm"
    return _FORCES_OF_MASSES.get(made, made)


def split_unit(name: str) -> tuple[str, str | None]:
    """Return a column's name without its unit, and that unit as study.toml writes it; None if the name states none.

    Examples
    --------
    >>> split_unit("Current [mA]"), split_unit("q_deg"), split_unit("LoadCell ()")
    (('Current', 'mA'), ('q', 'deg'), ('LoadCell', None))
    """
    before, end = name[:-MAX_UNIT_PLACE], name[-MAX_UNIT_PLACE:]
    rest, unit = _split_end(end)
    return f"{before}{rest}", unit


def _split_end(name: str) -> tuple[str, str | None]:
    """Return the end of a name without its unit, and that unit."""
    for match in reversed(list(_BRACKETED_TEXT.finditer(name))):
        # "q[1]" and "actuators[1].torque" are places in a list; "duty [1]" has no unit.
        if match[1] == "1" and (match[0][:1] != " " or name[match.end() :].strip()):
            continue
        unit = _bracketed_unit(match[1])
        if unit is not None or not match[1]:
            return _without(name, match.start(), match.end()), unit
    after = re.search(r"\s*(?:,\s*|\s/\s*|\s+in\s+)([^,\s][^,]*?)\s*$", name)
    if after is not None and after.start() > 0 and (unit := _bracketed_unit(after[1])) is not None:
        return name[: after.start()].strip(), unit
    return _split_suffix(name)


def stated_unit_text(name: str) -> str | None:
    """Return what stands in the last brackets of a name, whether it is a unit or not; None if nothing does.

    A unit with its number may stand at the end without brackets, as in pos_0.1deg.
    """
    end = name[-MAX_UNIT_PLACE:]
    found = [match[1] for match in _BRACKETED_TEXT.finditer(end) if match[1]]
    if not found and (scaled := _SCALED_SUFFIX.search(end)) is not None:
        return scaled[1]
    return found[-1] if found else None


def ends_in_multiple(name: str) -> str | None:
    """Return the end of a name that says a multiple of a unit, such as "Nm_x10"; None if it ends in none.

    Whether the unit or the number was multiplied, such a name leaves open.
    """
    found = _MULTIPLE.search(name[-MAX_UNIT_PLACE:])
    if found is None:
        return None
    before = name[-MAX_UNIT_PLACE:][: found.start()].rstrip("_ ")
    rest, unit = _split_end(before)
    text = before[len(rest) :].strip("_ ") if unit is not None and before.startswith(rest) else ""
    return f"{text} {found[0].strip()}".strip()


def _without(name: str, start: int, end: int) -> str:
    """Return a name without the characters from `start` to `end`."""
    rest = name[end:]
    gap = " " if name[:start].strip() and rest[:1].isalnum() else ""
    return f"{name[:start]}{gap}{rest}".strip() or name


def _bracketed_unit(text: str) -> str | None:
    plain = text.strip()
    return _BRACKETED_LETTERS.get(plain) or unit_from_text(plain)


def _split_suffix(name: str) -> tuple[str, str | None]:
    marks = [match.start() for match in re.finditer(r"(?<=[A-Za-z0-9)])[_ -](?=[A-Za-z%°µμ])", name)]
    for start in sorted(marks)[-_MAX_SUFFIX_PARTS:]:
        last = re.split(r"[\W_]+", name[:start].casefold())[-1].rstrip("0123456789")
        unit = _suffix_unit(name[start + 1 :], last, name[start] == "_")
        if unit is not None:
            return name[:start].strip(), unit
    head, dot, last = name.rpartition(".")
    if dot and len(last) > 1:
        # "velocity_rad_s.pan": the unit stands before the joint.
        rest, unit = _split_suffix(head)
        if unit is not None:
            return f"{rest}.{last}", unit
    within = list(_UNIT_WITHIN.finditer(name))
    if within and within[-1].start() > 0:
        return _without(name, within[-1].start(), within[-1].end()), unit_from_text(within[-1][1])
    match = _UNIT_AT_CAPITAL.search(name)
    if match is not None:
        text = {"DegPerSec": "deg/s", "RadPerSec": "rad/s"}.get(match[0], match[0])
        return name[: match.start()], unit_from_text(text)
    return name, None


def _suffix_unit(text: str, last: str, after_underscore: bool) -> str | None:
    """Return the unit that the end of a name is, after the word `last`; None if it is none for certain."""
    if len(text) == 1:
        by_mark = last == "in" or (after_underscore and text in _LETTERS_AFTER_UNDERSCORE)
        is_unit = by_mark or last in _WORDS_WITH_LETTER.get(text, ())
        return unit_from_text(text) if is_unit else None
    folded = text.casefold()
    if folded in _SUFFIX_TEXTS:
        return _SUFFIX_TEXTS[folded]
    if folded in _UNIT_WORDS or (folded in ("gon", "grad") and last in _ANGLE_WORDS):
        return unit_from_text(text)
    if _SHARE_OF_RATED.fullmatch(folded) is not None:
        return unit_from_text(folded.replace("_", " "))
    if (match := _PER_SECOND.fullmatch(text)) is not None:
        unit = unit_from_text(match[1])
        return f"{unit}/s^2" if match[2] else f"{unit}/s"
    if folded == "rev" and last in {"pos", "position", "angle", "q", "theta", "enc", "encoder", "estimate"}:
        return "turn"
    if last in ("stiffness", "k", "kp") and text in ("N_m", "Nm_rad"):
        return {"N_m": "N/m", "Nm_rad": "N*m/rad"}[text]
    plain = re.sub(r"_?per_?", "/", text).replace("_", "*")
    parts = [part for part in re.split(r"[/*.·⋅\s-]+", plain) if part]
    # Compound units are certain if no part may be a word.
    certain = len(parts) > 1 and all(p.casefold() in _UNIT_WORDS or p in _COMPOUND_PARTS for p in parts)
    return unit_from_text(plain) if certain else None




def is_unit_row(fields: list[str]) -> bool:
    """Whether the fields of a row are units: at least half of those that are filled are known, and none is a number."""
    filled = [field for field in fields if field.strip()]
    known = [field for field in filled if unit_from_text(field) is not None]
    return len(known) > 0 and 2 * len(known) >= len(filled) and len(known) >= len(fields) / 4
