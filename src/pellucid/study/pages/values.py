"""Numbers that a page shows under the id of their row in results.json, so that one number has one value everywhere.

A `Value` is put into any text of a page, ``f"an error of {value} %"``. The text then carries the id and the number in
characters that no reader sees; the page's template turns them into ``<data>`` elements, and `plain_text` removes them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from markupsafe import Markup, escape

from .quantities import VALUE_END, without_negative_zero

_HIDDEN_START = "\uf8f0"
_HIDDEN_END = "\uf8f1"
_HIDDEN_OFFSET = 0xE000
_HIDDEN_CHARACTERS = {code: _HIDDEN_OFFSET + code for code in range(128)}
_SHOWN_CHARACTERS = {hidden: code for code, hidden in _HIDDEN_CHARACTERS.items()}
_VALUE_PATTERN = re.compile(f"{_HIDDEN_START}([^{_HIDDEN_END}]*){_HIDDEN_END}([^{VALUE_END}]*){VALUE_END}")
_ID_SEPARATOR = "|"


@dataclass(frozen=True)
class Value:
    """A number as a page shows it.

    Parameters
    ----------
    id : str
        Id of the number's row in results.json.
    number : float
        The number itself, in the row's unit.
    text : str
        Its digits, as every part of a page shows them.
    """

    id: str
    number: float
    text: str

    def __str__(self) -> str:
        """Return the digits with the id and the number, for the text of a page."""
        hidden = f"{self.id}{_ID_SEPARATOR}{self.number!r}".translate(_HIDDEN_CHARACTERS)
        return f"{_HIDDEN_START}{hidden}{_HIDDEN_END}{self.text}{VALUE_END}"


def plain_text(text: str) -> str:
    """Return a page's text as it is read: digits without their ids."""
    return _VALUE_PATTERN.sub(r"\2", text)


def marked_up(text: str) -> Markup:
    """Return a page's text as HTML: a ``<data>`` element for each value, everything else escaped."""
    parts, last = [], 0
    for found in _VALUE_PATTERN.finditer(text):
        name, number = found[1].translate(_SHOWN_CHARACTERS).rsplit(_ID_SEPARATOR, 1)
        shown = without_negative_zero(found[2])
        element = Markup('<data value="{}" data-id="{}">{}</data>').format(number, name, shown)
        parts += [escape(without_negative_zero(text[last : found.start()])), element]
        last = found.end()
    return Markup("").join([*parts, escape(without_negative_zero(text[last:]))])
