"""Schema of a model card's file: types of its fields, plausible numbers, intervals that contain their values."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from .. import _given
from .._errors import PellucidError
from ..units import to_si_factor

MAX_CARD_NUMBER = 1e9
"""Largest absolute value of any number of a card, variances excepted, in SI."""

MAX_CARD_VARIANCE = 1e30
"""Largest absolute value of a variance. That of a parameter that was not determined is huge."""

MAX_TEXT_LENGTH = 2000
"""Largest number of characters of a text in a card."""

MAX_ENTRY_COUNT = 10_000
"""Largest number of entries of a list or an object in a card."""


def fields_of(kind: type, table: Any, *, missing: bool = False) -> dict[str, Any]:
    """The fields of a dataclass as a JSON object has them, ValueError if they are others; with `missing`, null stands
    for a number that is not there."""
    if not isinstance(table, Mapping):
        raise ValueError(f"found {_short(table)}, expected an object")
    known, hints = {f.name: f for f in fields(kind)}, get_type_hints(kind)
    unknown = sorted(set(table) - set(known))
    if unknown:
        raise ValueError(f"found the unknown key {_short(unknown[0])}, expected some of {', '.join(known)}")
    lacking = [n for n, f in known.items() if n not in table and f.default is MISSING and f.default_factory is MISSING]
    if lacking:
        raise ValueError(f"found no {', '.join(lacking)}, expected every required key")
    return {name: _typed(hints[name], value, name, missing) for name, value in table.items()}


def _typed(hint: Any, x: Any, where: str, missing: bool) -> Any:
    """`x`, if it is of the type that a field's hint says."""
    origin, within = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        if x is None and type(None) in within:
            return None
        kinds = [k for k in within if k is not type(None)]
        # The value's own type is chosen among several; an integer may stand for a float.
        chosen = next((k for k in kinds if type(x) is k), float if type(x) is int and float in kinds else kinds[0])
        return _typed(chosen, x, where, missing)
    if isinstance(hint, type) and is_dataclass(hint):
        try:
            return hint(**fields_of(hint, x, missing=missing))
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
    if origin is tuple:
        if not isinstance(x, list) or len(x) > MAX_ENTRY_COUNT:
            raise ValueError(f"{where}: found {_short(x)}, expected a list of at most {MAX_ENTRY_COUNT}")
        if within[-1] is not Ellipsis and len(x) != len(within):
            raise ValueError(f"{where}: found {len(x)} entries, expected {len(within)}")
        each = [within[0]] * len(x) if within[-1] is Ellipsis else within
        return tuple(_typed(k, y, f"{where}[{i}]", missing) for i, (k, y) in enumerate(zip(each, x, strict=True)))
    if origin is not None:
        if not isinstance(x, Mapping) or len(x) > MAX_ENTRY_COUNT:
            raise ValueError(f"{where}: found {_short(x)}, expected an object with at most {MAX_ENTRY_COUNT} keys")
        return {
            _typed(str, k, where, missing): _typed(within[1], y, f"{where}.{k[:50]}", missing) for k, y in x.items()
        }
    if hint is float:
        if x is None and missing:
            return math.nan
        if isinstance(x, bool) or not isinstance(x, (int, float)) or not abs(x) <= MAX_CARD_VARIANCE:
            raise ValueError(f"{where}: found {_short(x)}, expected a number")
        return float(x)
    if type(x) is not hint:
        raise ValueError(f"{where}: found {_short(x)}, expected {hint.__name__}")
    if hint is int and abs(x) > MAX_CARD_NUMBER:
        raise ValueError(f"{where}: found {_short(x)}, expected at most {MAX_CARD_NUMBER:g}")
    if hint is str and (len(x) > MAX_TEXT_LENGTH or _given.visible_text(x) != x):
        raise ValueError(f"{where}: found {_short(x)}, expected at most {MAX_TEXT_LENGTH} characters that can be seen")
    return x


def require_sound(path: Path, card: Any) -> None:
    """Refuse a card whose parameters, covariance or words no identification could have written."""
    try:
        for name in ("name", "joint"):
            text = getattr(card, name, "")
            if text and re.fullmatch(_given.STEM_PATTERN, text) is None:
                raise ValueError(f"{name}: found {_short(text)}, expected letters, digits, blanks and . - _")
        if not 0.0 < card.confidence < 1.0:
            raise ValueError(f"confidence: found {card.confidence:g}, expected above 0 and below 1")
        for text in card.checksums.values():
            if re.fullmatch(r"[0-9a-f]{64}|", text) is None:
                raise ValueError(f"checksums: found {_short(text)}, expected 64 hexadecimal digits")
        parameters = (*card.parameters, *filter(None, [getattr(card, "presliding_travel", None)]))
        _require_sound_parameters(parameters)
        for rows in (card.covariance, getattr(card, "statistical", ())):
            _require_covariance(rows, len(card.parameters))
    except ValueError as error:
        raise PellucidError(f"{path}: not a card that can be used: {error}") from None
    for p in parameters:
        to_si_factor(p.unit, None, f"{path}: {p.name}")


def _require_sound_parameters(parameters: Iterable[Any]) -> None:
    seen = set()
    for p in parameters:
        if re.fullmatch(r"[\w .:^*+-]{1,100}", p.name) is None or p.name in seen:
            raise ValueError(f"found the parameter {_short(p.name)}, expected a name, each once")
        seen.add(p.name)
        require_between(p.name, p.value, -MAX_CARD_NUMBER, MAX_CARD_NUMBER)
        if p.standard_error < 0.0:
            raise ValueError(f"{p.name}: found the standard error {p.standard_error:g}, expected 0 or more")
        if p.interval is None:
            continue
        low, high = p.interval
        slack = 1e-9 * max(abs(p.value), abs(high - low) if math.isfinite(high - low) else 0.0)
        if low - slack > p.value or high + slack < p.value or low > high:
            raise ValueError(f"{p.name}: found {p.value:g}, expected a value within its interval, {low:g} to {high:g}")


def _require_covariance(rows: tuple[tuple[float, ...], ...], n: int) -> None:
    if rows and (len(rows) != n or any(len(row) != n for row in rows)):
        raise ValueError(f"covariance: found {len(rows)} rows, expected {n} of {n} numbers")
    for i, row in enumerate(rows):
        for j, x in enumerate(row):
            # Beyond what rounding leaves, no two parameters vary together more than each does.
            bound = math.sqrt(abs(row[i] * rows[j][j]))
            if row[i] < 0.0 or abs(x) > 1.001 * bound + 1e-300 or abs(x - rows[j][i]) > 1e-6 * bound + 1e-300:
                raise ValueError(f"covariance: found {x:g} in row {i}, column {j}, expected that of a covariance")


def require_between(name: str, value: float, low: float, high: float) -> None:
    """ValueError if a number is none that a machine may have."""
    if not low <= value <= high:
        raise ValueError(f"{name}: found {value:g}, expected {low:g} to {high:g}")


def _short(x: Any) -> str:
    try:
        text = _given.visible_text(repr(x))
    except ValueError:  # an integer too long to be written
        text = "a number of too many digits"
    return text if len(text) <= 100 else f"{text[:100]}..."
