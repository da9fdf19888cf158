"""Decide what commas and full stops mean in a file's numbers: a decimal mark, or a mark between thousands.

A number such as ``1,012`` has two readings. Others in the same column or file have one: ``0,5`` and ``1.234,5`` have a
decimal comma, ``1,234,567``, ``1,234.5`` and ``0.5`` have a decimal point.

A column that writes 998 and 1.010 has a mark between thousands: with a decimal mark, its whole numbers would have the
same three digits, for it does not drop zeros at the end. An apostrophe or a blank can only stand between thousands.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

_DECIMAL_COMMA = re.compile(
    r"[-+]?(?:0|0\d+|\d{4,}|)?,\d+(?:e[-+]?\d+)?"  # 0,5  ,5  1234,567: thousands begin with one to three digits
    r"|[-+]?\d*,(?:\d{1,2}|\d{4,})(?:e[-+]?\d+)?"  # 1,5  1,2345
    r"|[-+]?\d+,\d+e[-+]?\d+"  # 1,012e3
    r"|[-+]?\d{1,3}(?:\.\d{3})+,\d*"  # 1.234,5
    r"|[-+]?\d{1,3}(?:\.\d{3}){2,}",  # 1.234.567
    re.IGNORECASE,
)
"""Numbers that have a decimal comma for certain."""

_DECIMAL_POINT = re.compile(
    r"[-+]?(?:0|0\d+|\d{4,}|)?\.\d+(?:e[-+]?\d+)?"
    r"|[-+]?\d*\.(?:\d{1,2}|\d{4,})?(?:e[-+]?\d+)?"
    r"|[-+]?\d+\.\d+e[-+]?\d+"
    r"|[-+]?\d{1,3}(?:,\d{3})+\.\d*"
    r"|[-+]?\d{1,3}(?:,\d{3}){2,}",
    re.IGNORECASE,
)
"""Numbers that have a decimal point for certain, or commas between thousands."""

_AMBIGUOUS_NUMBER = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")
"""Numbers that have both readings: 1,012 and 1.012."""

_WHOLE_BELOW_THOUSAND = re.compile(r"[-+]?[1-9]\d{0,2}")
"""Whole numbers without a mark. Zero is none: files often begin with a 0 that another part of a program writes."""

MIN_WHOLE_NUMBERS = 2
"""Different whole numbers that show a mark between thousands; a single one may stand for a missing sample."""

_GROUPED_NUMBER = re.compile(r"([-+]?\d{1,3}(?:['\u2019 \u00a0\u2009\u202f]\d{3})+)([.,]\d*)?")
"""Numbers with apostrophes or blanks between thousands: 9'990.00 and 9 990,00."""


@dataclass(frozen=True)
class CommaEvidence:
    """Numbers that tell what a comma and a full stop mean.

    Attributes
    ----------
    comma, point : str
        First number with a decimal comma, and first with a decimal point; "" without one.
    either : str
        First number that has both readings and stands in doubt: with a comma, or with a full stop beside whole numbers
        below a thousand; "" without one.
    thousands : str
        The mark that stands between thousands as the column's whole numbers show; "" if they do not.
    """

    comma: str = ""
    point: str = ""
    either: str = ""
    thousands: str = ""

    @property
    def decimal(self) -> str | None:
        """The decimal mark; None if no number tells it, or numbers contradict each other."""
        if self.comma and self.point:
            return None
        if self.comma or self.point:
            return "," if self.comma else "."
        return {"": None, ".": ",", ",": "."}[self.thousands]


def comma_evidence(fields: Iterable[str]) -> CommaEvidence:
    """Return what a column's fields tell of its commas and full stops."""
    comma = point = ""
    ambiguous = {",": "", ".": ""}
    whole: set[str] = set()
    keeps_zeros = False
    for field in fields:
        text = _without_groups(field)
        if "," not in text and "." not in text:
            if len(whole) < MIN_WHOLE_NUMBERS and _WHOLE_BELOW_THOUSAND.fullmatch(text):
                whole.add(text)
            continue
        if _AMBIGUOUS_NUMBER.fullmatch(text):
            mark = "," if "," in text else "."
            ambiguous[mark] = ambiguous[mark] or field
            keeps_zeros |= text.endswith("0")
        elif not comma and "," in text and _DECIMAL_COMMA.fullmatch(text):
            comma = field
        elif not point and _DECIMAL_POINT.fullmatch(text):
            point = field
        elif not comma and _DECIMAL_COMMA.fullmatch(text):
            comma = field
    marks = [mark for mark, text in ambiguous.items() if text]
    shown = len(marks) == 1 and keeps_zeros and len(whole) >= MIN_WHOLE_NUMBERS and not (comma or point)
    either = ambiguous[","] or (ambiguous["."] if whole else "")
    return CommaEvidence(comma, point, either, marks[0] if shown else "")


def may_hold_thousands(columns: Iterable[np.ndarray]) -> bool:
    """Return whether numbers read with a decimal point, each column (n,), may have points between thousands.

    They may not if one of them lies between 0 and 1, or has more than three decimals.
    """
    found = False
    for column in columns:
        known = column[np.isfinite(column)]
        if np.any((known != 0.0) & (np.abs(known) < 1.0)):
            return False
        thousands = 1e3 * known
        if np.any(np.abs(thousands - np.rint(thousands)) > 1e-9 * np.abs(thousands)):
            return False
        found |= bool(np.any(known != np.rint(known)))
    return found


def decimal_marks(columns: Sequence[CommaEvidence]) -> list[str | None]:
    """Return the decimal mark of each column: its own, else that of the file; None for a column with two readings.

    A column without commas whose points have both readings keeps its points.
    """
    tells = {column.decimal for column in columns} - {None}
    common = tells.pop() if len(tells) == 1 else None
    marks: list[str | None] = []
    for column in columns:
        if column.comma and column.point:
            marks.append(None)
        elif column.decimal is not None:
            marks.append(column.decimal)
        elif column.either:
            marks.append(common)
        else:
            marks.append(common or ".")
    return marks


TWO_READINGS = "with two readings"
"""Words in the message about a column whose decimal mark nothing tells."""


def two_readings(column: CommaEvidence) -> str:
    """Return why a column has no decimal mark, for a message."""
    if column.comma and column.point:
        return (
            f'holds a comma {TWO_READINGS}: "{column.comma}" has a decimal comma and "{column.point}" a decimal point; '
            "expected one of both throughout"
        )
    text = column.either
    mark, name, decimal = (",", "comma", "decimal comma") if "," in text else (".", "full stop", "decimal point")
    return (
        f'holds a {name} {TWO_READINGS}: "{text}" is {text.replace(",", ".")} with a {decimal} and '
        f"{text.replace(mark, '')} with a {name} between thousands; nothing in the file tells which"
    )


def _without_groups(text: str) -> str:
    """Return a number without apostrophes or blanks between its thousands; another text as it is."""
    found = _GROUPED_NUMBER.fullmatch(text)
    return text if found is None else re.sub(r"[^-+\d]", "", found[1]) + (found[2] or "")


def read_number(text: str, decimal: str) -> float | None:
    """Return a number with its decimal mark, and marks between its thousands; None if the text is none."""
    text = _without_groups(text)
    other = "." if decimal == "," else ","
    if other in text:
        mark, other = re.escape(decimal), re.escape(other)
        if re.fullmatch(rf"[-+]?\d{{1,3}}(?:{other}\d{{3}})+(?:{mark}\d*)?", text) is None:
            return None
        text = re.sub(other, "", text)
    try:
        return float(text.replace(decimal, "."))
    except ValueError:
        return None
