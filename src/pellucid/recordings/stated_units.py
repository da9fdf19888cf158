"""Read units as people write them in headers, and return them as study.toml writes them."""

from __future__ import annotations

import re

_UNITS_BY_TEXT = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "in s": "s", "ms": "ms", "msec": "ms",
        "millis": "ms",
    "milliseconds": "ms", "us": "us", "µs": "us", "usec": "us", "micros": "us", "microseconds": "us", "ns": "ns",
    "nsec": "ns", "nanoseconds": "ns", "min": "min", "deg": "deg", "degs": "deg", "degree": "deg", "degrees": "deg",
    "°": "deg", "grad": "deg", "rad": "rad", "rads": "rad", "radian": "rad", "radians": "rad", "turn": "turn",
        "turns": "turn",
    "rev": "turn", "deg/s": "deg/s", "°/s": "deg/s", "dps": "deg/s", "deg/sec": "deg/s", "deg per s": "deg/s",
    "degrees/s": "deg/s", "deg s": "deg/s", "rad/s": "rad/s", "rad/sec": "rad/s", "rad per s": "rad/s",
        "rad s": "rad/s",
    "rads/s": "rad/s", "rpm": "rpm", "rev/min": "rpm", "1/min": "rpm", "u/min": "rpm", "deg/s^2": "deg/s^2",
        "deg/s2": "deg/s^2",
    "rad/s^2": "rad/s^2", "rad/s2": "rad/s^2", "nm": "N*m", "n.m": "N*m", "n m": "N*m", "n*m": "N*m", "n-m": "N*m",
    "n·m": "N*m", "newton meter": "N*m", "newton meters": "N*m", "newtonmeter": "N*m", "mnm": "mN*m", "mn.m": "mN*m",
    "mn*m": "mN*m", "ncm": "cN*m", "n": "N", "newton": "N", "newtons": "N", "kn": "kN", "mn": "mN", "a": "A",
        "amp": "A", "amps": "A",
    "ampere": "A", "amperes": "A", "ma": "mA", "milliamps": "mA", "v": "V", "volt": "V", "volts": "V", "mv": "mV",
    "millivolts": "mV", "uv": "uV", "µv": "uV", "μv": "uV", "microvolts": "uV", "nv": "nV", "m": "m", "meter": "m",
        "meters": "m",
    "mm": "mm", "millimeters": "mm", "cm": "cm", "m/s": "m/s", "mm/s": "mm/s", "cm/s": "cm/s", "m/sec": "m/s",
        "m/s^2": "m/s^2",
    "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s/s": "m/s^2", "g": "g0", "mg": "mg0", "t": "T", "ut": "uT", "µt": "uT",
        "hz": "Hz",
    "khz": "kHz", "%": "%", "percent": "%", "pct": "%", "%mvc": "%MVC", "mvc": "MVC", "%mvic": "%MVC",
        "counts": "counts",
    "count": "counts", "cts": "counts", "qc": "counts", "inc": "counts", "ticks": "counts", "degc": "degC",
        "°c": "degC",
    "celsius": "degC", "c": "degC", "k": "K", "w": "W", "kg": "kg", "nm/rad": "N*m/rad", "nm per rad": "N*m/rad",
    "nm per rad per s": "N*m*s/rad", "nms/rad": "N*m*s/rad", "n*m/rad": "N*m/rad", "n/m": "N/m", "nm/a": "N*m/A",
    "n*m/a": "N*m/A", "mnm/a": "mN*m/A", "nm/v": "N*m/V", "n/v": "N/V", "n/a": "N/A", "ohm": "ohm", "dots": "counts",
    "px": "counts", "pixels": "counts", "1": "1", "-": "1", "bool": "1", "a.u.": "1", "au": "1",
}  # fmt: skip
"""Units as study.toml writes them, by how headers write them in lower case."""

_CASE_MATTERS = {"A": "A", "a": "", "N": "N", "n": "", "V": "V", "v": "", "T": "T", "t": "", "C": "", "K": "", "W": "W"}
"""Units of one letter. In the other case the letter is a name, such as t for time."""

_BRACKETED_UNIT = re.compile(r"[\[({]\s*+((?:[^\])}\s]++|\s++(?![\])}]))*+)\s*+[\])}]\s*$")

_WORDS_WITH_LETTER = {
    "s": {"time", "t", "stamp", "timestamp", "clock", "elapsed"},
    "m": {"position", "pos", "x", "y", "z", "displacement", "disp", "length", "height", "radius", "distance", "stroke",
        "travel", "q"},
    "g": {"acc", "acceleration", "accel", "ax", "ay", "az", "x", "y", "z"},
}  # fmt: skip
"""Last words of names after which a single small letter is a unit; elsewhere it is part of the name."""

_UNIT_SUFFIX = re.compile(
    r"(?<=[A-Za-z0-9])_((?:mN|N)\.?m(?:_?per_?rad)?(?:_?per_?rad)?(?:_?per_?s)?|deg(?:_?(?:per|/)?_?s(?:ec)?2?)?"
    r"|rad(?:_?(?:per|/)?_?s(?:ec)?2?)?|rpm|ms|us|ns|sec|mA|uV|mV|mm|cm|counts|pct|Hz|kN|m_?s2|mps2?|[sVANmg])$"
)

_SUFFIX_TEXTS = {
    "deg_per_s": "deg/s", "deg_s": "deg/s", "degs": "deg/s", "deg_per_sec": "deg/s", "deg_sec": "deg/s",
        "degps": "deg/s",
    "rad_per_s": "rad/s", "rad_s": "rad/s", "rads": "rad/s", "rad_per_sec": "rad/s", "rad_sec": "rad/s",
        "radps": "rad/s",
    "rad_s2": "rad/s^2", "rads2": "rad/s^2", "deg_s2": "deg/s^2", "Nm_per_rad": "N*m/rad",
        "Nm_per_rad_per_s": "N*m*s/rad",
    "m_s2": "m/s^2", "ms2": "m/s^2", "mps2": "m/s^2", "mps": "m/s",
}  # fmt: skip


def unit_from_text(text: str) -> str | None:
    """Return a unit as study.toml writes it, None if the text is no unit that is known.

    Examples
    --------
    >>> unit_from_text("Nm"), unit_from_text("°/s"), unit_from_text("torque")
    ('N*m', 'deg/s', None)
    """
    bare = re.sub(r"\s+", " ", text.strip().strip("[](){}").strip())
    if len(bare) == 1 and bare in _CASE_MATTERS:
        return _CASE_MATTERS[bare] or None
    if bare == "mN":
        return "mN"
    if bare in ("Ncm", "N cm"):
        return "cN*m"
    folded = bare.casefold().removeprefix("in ")
    return _UNITS_BY_TEXT.get(folded) or _UNITS_BY_TEXT.get(folded.replace("^", "").replace("**", ""))


def split_unit(name: str) -> tuple[str, str | None]:
    """Return a column's name without its unit, and that unit as study.toml writes it; None if the name states none.

    Examples
    --------
    >>> split_unit("Current [mA]"), split_unit("q_deg"), split_unit("LoadCell ()")
    (('Current', 'mA'), ('q', 'deg'), ('LoadCell', None))
    """
    match = _BRACKETED_UNIT.search(name)
    if match is not None:
        bare, unit = name[: match.start()].strip(), unit_from_text(match[1])
        if unit is not None or not match[1]:
            return bare or name, unit
    match = _UNIT_SUFFIX.search(name)
    if match is not None:
        unit = _SUFFIX_TEXTS.get(match[1]) or unit_from_text(match[1])
        last = re.split(r"[\W_]+", name[: match.start()].casefold())[-1].rstrip("0123456789")
        if unit is not None and last in _WORDS_WITH_LETTER.get(match[1], {last}):
            return name[: match.start()], unit
    return name, None


def is_unit_row(fields: list[str]) -> bool:
    """Whether the fields of a row are units: at least half of those that are filled are known, and none is a number."""
    filled = [field for field in fields if field.strip()]
    known = [field for field in filled if unit_from_text(field) is not None]
    return len(known) > 0 and 2 * len(known) >= len(filled) and len(known) >= len(fields) / 4
