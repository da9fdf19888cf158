"""What every table of study.toml is made of: quantities with units, and no key that nobody knows."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, field_validator

from .. import _given
from ..units import parse_quantity

if TYPE_CHECKING:
    from .study_file import StudyFile

NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"
"""What a study's name may look like."""

DERIVED = "\0"
"""What the names of fields begin with that follow from others; no person can write such a key."""


SMALLEST, LARGEST = 1e-30, 1e30
"""Magnitude of any plain number that is not 0."""

WHOLE = 10**9
"""Largest whole number."""

LONGEST = 10_000
"""Most characters of a text."""


def _word(text: str) -> str:
    if re.fullmatch(_given.NAME, text) is None:
        raise ValueError(f"found {text[:100]!r}, expected letters, digits, blanks and . - _, at most 100 of them")
    return text


Word = Annotated[str, AfterValidator(_word)]
"""What may become part of a file's name, of a column's or of a figure's id."""

Said = Annotated[str, Field(max_length=300)]
"""What is only shown."""

Place = Annotated[str, Field(min_length=1, max_length=1000)]
"""Of files, from the study's folder."""


class StudyTable(BaseModel):
    """A table; quantities are SI once it is read."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, hide_input_in_errors=True)

    @field_validator("*", mode="before")
    @classmethod
    def _legible(cls, value: Any) -> Any:
        for text in value if isinstance(value, (list, tuple)) else (value,):
            if isinstance(text, str) and (len(text) > LONGEST or text != _given.seen(text)):
                raise ValueError(f"found {text[:100]!r}, expected at most {LONGEST} characters that can be seen")
            if isinstance(text, int) and abs(text) > WHOLE:
                raise ValueError(f"found a whole number of {text.bit_length()} bits, expected at most {WHOLE}")
            if isinstance(text, float) and text and not SMALLEST <= abs(text) <= LARGEST:
                raise ValueError(f"found {text:g}, expected 0, or {SMALLEST:g} to {LARGEST:g} of either sign")
        return value


class ProcedureTable(StudyTable):
    """A table of study.toml that asks for a procedure."""

    alone: ClassVar[bool] = False
    """Whether no other such table may stand beside it: each is a study of its own."""

    several: ClassVar[bool] = False
    """Whether all joints of a machine are identified at once."""

    bridges: ClassVar[bool] = True
    """Whether it deals with gaps and missing samples by itself; otherwise they are cut out."""

    def reads(self, channel: str, stream: str) -> bool:
        """Whether a channel's spikes would spoil what is made of it; `stream` is "" for the recording's own file."""
        return False

    def require_in(self, config: StudyFile) -> None:
        """Raise ValueError where what the table names is not among the rest of study.toml."""


Table = TypeVar("Table", bound=ProcedureTable)
"""The class of a table that asks for a procedure."""


def quantity(expected: str, **bounds: float) -> Any:
    """Type of a field given as ``"1.5 V"``; an expected unit in <> is looked up among the rig's units."""

    def convert(value: Any, info: ValidationInfo) -> float | None:
        if value is None:
            return None
        units = info.context or {}
        unit = units.get(expected, expected) if expected.startswith("<") else expected
        return parse_quantity(value, unit, "")

    convert_text = BeforeValidator(convert, json_schema_input_type=str)
    return Annotated[float, Field(**bounds), convert_text, Field(description=f"number and unit ({expected})")]
