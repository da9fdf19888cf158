"""Decide what commas and full stops mean in a file's numbers: a decimal mark, or a mark between thousands.

A number such as ``1,012`` has two readings. Others in the same column or file have one: ``0,5`` and ``1.234,5`` have a
decimal comma, ``1,234,567``, ``1,234.5`` and ``0.5`` have a decimal point.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True)
class CommaEvidence:
    """Numbers that tell what a comma means.

    Attributes
    ----------
    comma, point : str
        First number with a decimal comma, and first with a decimal point; "" without one.
    either : str
        First number with a comma that has both readings; "" without one.
    """

    comma: str = ""
    point: str = ""
    either: str = ""

    @property
    def decimal(self) -> str | None:
        """The decimal mark; None if no number tells it, or numbers contradict each other."""
        if bool(self.comma) == bool(self.point):
            return None
        return "," if self.comma else "."


def comma_evidence(fields: Iterable[str]) -> CommaEvidence:
    """Return what a column's fields tell of its commas."""
    comma = point = either = ""
    for text in fields:
        if "," not in text and "." not in text:
            continue
        if _AMBIGUOUS_NUMBER.fullmatch(text):
            either = either or (text if "," in text else "")
        elif not comma and "," in text and _DECIMAL_COMMA.fullmatch(text):
            comma = text
        elif not point and _DECIMAL_POINT.fullmatch(text):
            point = text
        elif not comma and _DECIMAL_COMMA.fullmatch(text):
            comma = text
    return CommaEvidence(comma, point, either)


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


TWO_READINGS = "a comma with two readings"
"""Words in the message about a column whose decimal mark nothing tells."""


def two_readings(column: CommaEvidence) -> str:
    """Return why a column has no decimal mark, for a message."""
    if column.comma and column.point:
        return (
            f'holds {TWO_READINGS}: "{column.comma}" has a decimal comma and "{column.point}" a decimal point; '
            "expected one of both throughout"
        )
    text = column.either
    return (
        f'holds {TWO_READINGS}: "{text}" is {text.replace(",", ".")} with a decimal comma and '
        f"{text.replace(',', '')} with a comma between thousands; nothing in the file tells which"
    )


def read_number(text: str, decimal: str) -> float | None:
    """Return a number with its decimal mark, and marks between its thousands; None if the text is none."""
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
