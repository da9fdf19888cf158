"""Read settings stated in a file's header or in an accompanying file: rate, torque constant, gear ratio, supply."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..units import to_si_factor
from .name_evidence import read_name, words_of
from .stated_units import split_unit, unit_from_text

_NUMBER_TEXT = r"[-+]?(?:\d+(?:[.,]\d+)?|[.,]\d+)(?:[eE][-+]?\d+)?"

_RATE_TEXT = re.compile(
    rf"({_NUMBER_TEXT})\s*(?:samples per second|samples/s(?:ec)?|samples/second|sps\b|S/s|Hz)", re.IGNORECASE
)

_VALUE_WITH_UNIT = re.compile(rf"\s*({_NUMBER_TEXT})\s*([^\d].*)?")

_RATE_NAMES = frozenset({
    "rate", "fs", "samplerate", "samplingrate", "samplingfrequency", "sampfreq", "samplefrequency", "srate", "freq",
    "frequency", "fps",
})  # fmt: skip

_PERIOD_NAMES = frozenset({
    "dt", "ts", "tsample", "sampletime", "samplingtime", "samplingperiod", "sampleperiod", "stepsize",
})  # fmt: skip

_SAMPLING_WORDS = frozenset({
    "sampling", "sample", "sampled", "acquisition", "recording", "data", "logging", "log", "scan",
})  # fmt: skip

_SIMULATION_WORDS = frozenset({"simulated", "simulation", "simulator", "synthetic"})

_DENIALS = frozenset({"no", "not", "non", "false", "without"})

NOMINAL_RATE_FACT = "nominal_srate"
"""Ending of the name of a fact that is the nominal rate of one stream of a file [Hz], after the stream's name."""

MUSCLE_FACT = "target_muscle"
"""Ending of the name of a fact that is the muscle of one channel of a file, after the channel's name."""

MAX_RATE_HZ = 1e6
"""A number that is said to be a sampling rate is at most this [Hz]."""


@dataclass(frozen=True)
class FileFact:
    """A setting of a file."""

    value: float  # value in `unit`
    unit: str  # unit, as study.toml writes it
    label: str  # label in the file

    @property
    def text(self) -> str:
        """The value with its unit, as study.toml writes it."""
        return f"{self.value:.12g} {self.unit}"


def states_simulation(texts: Iterable[str]) -> bool:
    """Return whether one of a file's texts, such as its name and the lines above its numbers, says it is simulated."""
    words = (set(words_of(text)) for text in texts)
    return any(_SIMULATION_WORDS & each and not _DENIALS & each for each in words)


def find_rate(facts: Mapping[str, str]) -> FileFact | None:
    """Return the sampling rate that a file states [Hz], by its rate, its frequency or its period; None if it states
    none."""
    for label, text in facts.items():
        words, joined = set(words_of(label)), "".join(words_of(label))
        value = _value(_one_for_all(text))
        if value is None:
            continue
        number, unit = value
        unit = unit or split_unit(label)[1]
        about = bool(words & _SAMPLING_WORDS)
        if (words & {"rate", "frequency", "freq", "hz"} and (about or joined in _RATE_NAMES)) or joined in _RATE_NAMES:
            factor = 1e3 if unit == "kHz" else 1.0
            if unit in (None, "Hz", "kHz", "1") and 0.1 < number * factor <= MAX_RATE_HZ:
                return FileFact(number * factor, "Hz", label)
        if (words & {"period", "interval", "time", "step", "dt"} and about) or joined in _PERIOD_NAMES:
            seconds = number * {"ms": 1e-3, "us": 1e-6, "s": 1.0, None: 1.0}.get(unit, float("nan"))
            if unit is None and number >= 0.5:
                continue
            if 1.0 / MAX_RATE_HZ <= seconds <= 10.0:
                return FileFact(float(f"{1.0 / seconds:.9g}"), "Hz", label)
    return _rate_in_texts(facts)


def _one_for_all(text: str) -> str:
    """Return the number that a setting repeats for each channel, as in "500,500"; any other text as it is."""
    parts = [part.strip() for part in re.split(r"[,;\t]", text)]
    return parts[0] if len(parts) > 1 and len(set(parts)) == 1 and parts[0] else text


def _rate_in_texts(facts: Mapping[str, str]) -> FileFact | None:
    """Return the largest rate that a sentence states, because resampled data are stored at the file's own rate."""
    found = [
        (number, label)
        for label, text in facts.items()
        for match in _RATE_TEXT.finditer(text)
        if (number := _number(match[1])) is not None
        and not set(words_of(label)) & {"filter", "lowpass", "highpass", "bandwidth", "notch", "cutoff", "pwm"}
        and not re.search(r"filter|pass|notch", text[max(0, match.start() - 15) : match.start()], re.IGNORECASE)
    ]
    best = max(found, default=None)
    return FileFact(best[0], "Hz", best[1]) if best and best[0] >= 1.0 else None


def find_drive_facts(facts: Mapping[str, str]) -> dict[str, FileFact]:
    """Return what a file states of its drive: ``torque_constant``, ``force_constant``, ``gear_ratio``, ``resistance``,
    ``supply``."""
    found: dict[str, FileFact] = {}
    for label, text in facts.items():
        value = _value(text)
        if value is None or value[0] <= 0.0:
            continue
        number, unit = value
        unit = unit or split_unit(label)[1]
        words = words_of(split_unit(label)[0])
        joined = "".join(words)
        if joined in ("kt", "torqueconstant", "motortorqueconstant", "drehmomentkonstante", "motorconstant") or (
            "torque" in words and "constant" in words
        ):
            _add(found, "torque_constant", number, unit, label, ("N*m/A", "N*m/V"))
        elif "force" in words and "constant" in words:
            _add(found, "force_constant", number, unit, label, ("N/A", "N/V"))
        elif ("gear" in words or "reduction" in words or "ratio" in words) and joined in (
            "gear", "gearratio", "reduction", "gearreduction", "ratio", "transmissionratio", "reductionratio",
                "gearboxratio",
        ):  # fmt: skip
            found["gear_ratio"] = FileFact(_ratio(text, number), "1", label)
        elif words[:1] in (["rated"], ["nominal"]) or {"rated", "nominal"} & set(words):
            kind = next((k for k in ("torque", "current") if k in words or split_unit(label)[1] == k), None)
            if kind is not None:
                _add(found, f"rated_{kind}", number, unit, label, ("N*m",) if kind == "torque" else ("A",))
        elif joined in ("resistance", "windingresistance", "terminalresistance", "motorresistance"):
            _add(found, "resistance", number, unit, label, ("ohm",))
        elif joined in ("supply", "supplyvoltage", "busvoltage", "batteryvoltage", "vin", "vbus"):
            # A bare number is in volts; one with a unit that is not known is in none.
            bare = _VALUE_WITH_UNIT.fullmatch(text)
            _add(found, "supply", number, unit or ("" if bare and bare[2] else "V"), label, ("V",))
    return found


_ENCODER_BITS = re.compile(r"\b(\d{1,2})[ -]?bits?\b", re.IGNORECASE)

_COUNTS_OF_TURN = frozenset({
    "cpr", "ppr", "countsperturn", "countsperrev", "countsperrevolution", "ticksperrev", "ticksperturn",
    "ticksperrevolution", "encodercounts", "encodercpr", "encoderresolution", "encodercountsperrev",
    "encodercountsperturn", "resolution",
})  # fmt: skip


def find_encoder_counts(facts: Mapping[str, str]) -> FileFact | None:
    """Return how many counts the encoder has for one turn, as a file states them; None if it states none."""
    for label, text in facts.items():
        joined, value = "".join(words_of(label)), _value(text)
        is_encoder = "encoder" in joined or "encoder" in text.casefold()
        bits = _ENCODER_BITS.search(f"{label} {text}") if is_encoder else None
        if bits is not None and 8 <= int(bits[1]) <= 32:
            return FileFact(float(2 ** int(bits[1])), "counts", label)
        if joined in _COUNTS_OF_TURN and value is not None and value[0] >= 64 and value[1] in (None, "counts"):
            return FileFact(value[0], "counts", label)
    return None


_UNIT_LABELS = frozenset({"unit", "units", "einheit", "einheiten", "unite", "unites", "unité", "unités", "unidad",
                          "unidades", "unita", "unità"})  # fmt: skip
"""Words of a setting that states a unit."""


def stated_units(facts: Mapping[str, str], columns: Iterable[str]) -> dict[str, str]:
    """Return the units that settings state of a quantity, by the columns of this quantity, as in "Torque units: in-lb".

    >>> stated_units({"Torque units": "in-lb", "Angle units": "deg"}, ["Sample", "Angle", "Torque"])
    {'Torque': 'in-lb', 'Angle': 'deg'}
    """
    names = {name: read_name(name) for name in columns}
    found: dict[str, str] = {}
    for label, text in facts.items():
        words = words_of(label)
        about = [word for word in words if word not in _UNIT_LABELS and word not in ("of", "the")]
        if len(about) == len(words) or not about or unit_from_text(text) is None:
            continue
        quantity = read_name(" ".join(about)).quantity
        for name, evidence in names.items():
            if quantity is not None and evidence.quantity == quantity and evidence.unit is None:
                found.setdefault(name, text.strip())
    return found


def _add(
    found: dict[str, FileFact], key: str, number: float, unit: str | None, label: str, expected: Iterable[str]
) -> None:
    """Add a fact if its unit is one of those expected: without a unit it would be one in silence."""
    for si in expected:
        try:
            factor, _ = to_si_factor(unit or "", si)
        except ValueError:
            continue
        found.setdefault(key, FileFact(number * factor, si, label))
        return


def _ratio(text: str, number: float) -> float:
    """Return a gear ratio that may be written as 100:1 or 1:100."""
    parts = re.match(rf"\s*({_NUMBER_TEXT})\s*[:/]\s*({_NUMBER_TEXT})", text)
    if parts is None:
        return number
    a, b = (_number(part) for part in parts.groups())
    return max(a, b) / min(a, b) if a and b and min(a, b) > 0.0 else number


def _value(text: str) -> tuple[float, str | None] | None:
    match = _VALUE_WITH_UNIT.fullmatch(text)
    if match is None:
        return None
    number, rest = _number(match[1]), (match[2] or "").strip()
    return None if number is None else (number, _unit_before_remark(rest) if rest else None)


def _unit_before_remark(text: str) -> str | None:
    """Return the unit with which a text begins, as in "Nm/A at the motor"; None if it begins with none."""
    whole = unit_from_text(text)
    if whole is not None:
        return whole
    words = text.split()
    is_remark = re.search(r"[(,;]|\b(?:at|of|on|per|for|measured|nominal|rated|typical)\b", text)
    if is_remark is None or len(words) < 2:
        return None
    return unit_from_text(text[: is_remark.start()].strip()) if is_remark.start() > 0 else None


def is_behind_gear(fact: FileFact, facts: Mapping[str, str]) -> bool:
    """Whether a file says that a constant holds at the joint, behind the gear, and not at the motor."""
    said = set(words_of(f"{fact.label} {facts.get(fact.label, '')}"))
    return bool(said & {"joint", "output", "load"}) and not said & {"motor", "rotor"}


def _number(text: str) -> float | None:
    """Return a number with a decimal point or comma; None if the comma may stand between thousands, as in 1,000."""
    return None if re.fullmatch(r"[-+]?[1-9]\d{0,2},\d{3}", text) else float(text.replace(",", "."))
