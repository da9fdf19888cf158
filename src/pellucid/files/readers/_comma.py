"""Decide what commas and full stops mean in a file's numbers: a decimal mark, or a mark between thousands.

A number such as ``1,012`` has two readings. Others in the same column or file have one: ``0,5`` and ``1.234,5`` have a
decimal comma, ``1,234,567``, ``1,234.5`` and ``0.5`` have a decimal point.

A column that writes 998 and 1.010 has a mark between thousands: with a decimal mark, its whole numbers would have the
same three digits, for it does not drop zeros at the end. An apostrophe or a blank can only stand between thousands.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

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


@dataclass
class CommaEvidence:
    """What the fields of a column tell of its commas and full stops; `add` takes them in parts.

    Attributes
    ----------
    comma, point : str
        First number with a decimal comma, and first with a decimal point; "" without one.
    ambiguous : dict of str to str
        First number with both readings, by its mark; "" without one.
    whole : set of str
        Some different whole numbers below a thousand, at most `MIN_WHOLE_NUMBERS`.
    keeps_zeros : bool
        Whether a number with both readings ends in a zero.
    """

    comma: str = ""
    point: str = ""
    ambiguous: dict[str, str] = field(default_factory=lambda: {",": "", ".": ""})
    whole: set[str] = field(default_factory=set)
    keeps_zeros: bool = False

    def add(self, fields: Sequence[str]) -> None:
        """Take more fields of the column."""
        if self.point and plain_numbers(fields) is not None:
            return  # no comma can be among them, and points are known
        for field_text in dict.fromkeys(fields):
            text = _without_groups(field_text)
            if "," not in text and "." not in text:
                if len(self.whole) < MIN_WHOLE_NUMBERS and _WHOLE_BELOW_THOUSAND.fullmatch(text):
                    self.whole.add(text)
            elif _AMBIGUOUS_NUMBER.fullmatch(text):
                mark = "," if "," in text else "."
                self.ambiguous[mark] = self.ambiguous[mark] or field_text
                self.keeps_zeros |= text.endswith("0")
            elif not self.comma and "," in text and _DECIMAL_COMMA.fullmatch(text):
                self.comma = field_text
            elif not self.point and _DECIMAL_POINT.fullmatch(text):
                self.point = field_text
            elif not self.comma and _DECIMAL_COMMA.fullmatch(text):
                self.comma = field_text

    @property
    def either(self) -> str:
        """Return the first ambiguous number: with a comma, or with a full stop among whole numbers below a thousand."""
        return self.ambiguous[","] or (self.ambiguous["."] if self.whole else "")

    @property
    def decimal(self) -> str | None:
        """Return the decimal mark; None if no number shows it, or numbers contradict each other."""
        if self.comma or self.point:
            return None if self.comma and self.point else "," if self.comma else "."
        marks = [mark for mark, text in self.ambiguous.items() if text]
        if len(marks) == 1 and self.keeps_zeros and len(self.whole) >= MIN_WHOLE_NUMBERS:
            return {".": ",", ",": "."}[marks[0]]
        return None


def plain_numbers(fields: Sequence[str]) -> np.ndarray | None:
    """Return the numbers of fields that Python reads without help, shape (n,); None if one is none."""
    try:
        return np.array(fields, dtype=np.float64)
    except ValueError:
        return None


USUAL_EVIDENCE_ROWS = 1000
"""Number of first rows that are searched for the decimal mark before all others are."""


def may_hold_thousands(columns: Iterable[np.ndarray]) -> bool:
    """Return whether numbers read with a decimal point, each column (n,), may have points between thousands.

    They may not if one of them lies between 0 and 1, or has more than three decimals.
    """
    found = False
    columns = [column for column in columns if not (_is_whole(column[:USUAL_EVIDENCE_ROWS]) and _is_whole(column))]
    # Most files show it in their first rows.
    for column in (*(column[:USUAL_EVIDENCE_ROWS] for column in columns), *columns):
        known = column[np.isfinite(column)]
        if np.any((known != 0.0) & (np.abs(known) < 1.0)):
            return False
        thousands = 1e3 * known
        if np.any(np.abs(thousands - np.rint(thousands)) > 1e-9 * np.abs(thousands)):
            return False
        found |= bool(np.any(known != np.rint(known)))
    return found


def _is_whole(column: np.ndarray) -> bool:
    return np.array_equal(column, np.rint(column))


def has_whole_numbers(column: np.ndarray) -> bool:
    """Return whether a column, shape (n,), has as many different whole numbers as show a mark between thousands."""
    whole = column[(column == np.rint(column)) & (column != 0.0) & (np.abs(column) < 1000.0)]
    return len(np.unique(whole)) >= MIN_WHOLE_NUMBERS


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
            "expected the same decimal mark throughout"
        )
    text = column.either
    mark, name, decimal = (",", "comma", "decimal comma") if "," in text else (".", "full stop", "decimal point")
    return (
        f'holds a {name} {TWO_READINGS}: "{text}" is {text.replace(",", ".")} with a {decimal} and '
        f"{text.replace(mark, '')} with a {name} between thousands; the file does not decide which"
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
