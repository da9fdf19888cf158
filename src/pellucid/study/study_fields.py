"""Base classes and field types of the tables in study.toml: quantities have units, and unknown keys are refused."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, field_validator

from .. import _given
from ..units import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Collection

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"
"""Pattern of a study's name."""

DERIVED_PREFIX = "\0"
"""First character in the names of fields that are computed from others; no person can write such a key."""

MIN_NUMBER_MAGNITUDE = 1e-30
"""Smallest accepted magnitude of a plain number that is not 0."""

MAX_NUMBER_MAGNITUDE = 1e30
"""Largest accepted magnitude of a plain number."""

MAX_WHOLE_NUMBER = 10**9
"""Largest accepted magnitude of a whole number."""

MAX_TEXT_LENGTH = 10_000
"""A text has at most this many characters."""


def _word(text: str) -> str:
    if re.fullmatch(_given.NAME_PATTERN, text) is None:
        raise ValueError(f"found {text[:100]!r}, expected letters, digits, blanks and . - _, at most 100 of them")
    return text


Word = Annotated[str, AfterValidator(_word)]
"""Text that may become part of the name of a file or column, or of a figure's id."""

ShownText = Annotated[str, Field(max_length=300)]
"""Text that is only shown."""

RelativePath = Annotated[str, Field(min_length=1, max_length=1000)]
"""Path of a file, relative to the study's folder."""


class StudyTable(BaseModel):
    """A table of study.toml. Its quantities are converted to SI when it is read."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, hide_input_in_errors=True)

    @field_validator("*", mode="before")
    @classmethod
    def _legible(cls, value: Any, info: ValidationInfo) -> Any:
        annotation = cls.model_fields[info.field_name or ""].annotation
        if bool in (annotation, *get_args(annotation)) and value is not None and not isinstance(value, bool):
            raise ValueError(f"found {value!r:.100}, expected true or false")
        for text in value if isinstance(value, (list, tuple)) else (value,):
            if isinstance(text, str) and (len(text) > MAX_TEXT_LENGTH or text != _given.visible_text(text)):
                raise ValueError(
                    f"found {text[:100]!r}, expected at most {MAX_TEXT_LENGTH} characters that can be seen"
                )
            if isinstance(text, int) and abs(text) > MAX_WHOLE_NUMBER:
                raise ValueError(
                    f"found a whole number of {text.bit_length()} bits, expected at most {MAX_WHOLE_NUMBER}"
                )
            if isinstance(text, float) and text and not MIN_NUMBER_MAGNITUDE <= abs(text) <= MAX_NUMBER_MAGNITUDE:
                raise ValueError(
                    f"found {text:g}, expected 0, or {MIN_NUMBER_MAGNITUDE:g} to {MAX_NUMBER_MAGNITUDE:g} of either "
                    "sign"
                )
        return value


class ProcedureTable(StudyTable):
    """A table of study.toml that requests a procedure."""

    alone: ClassVar[bool] = False  # Whether a study with this table may have no other such table
    several: ClassVar[bool] = False  # Whether the procedure identifies all joints of a machine at once
    # Whether the procedure handles gaps and missing samples by itself; otherwise they are cut out
    bridges: ClassVar[bool] = True

    @classmethod
    def table_name(cls) -> str:
        """Return its name in study.toml: that of `EmgTorqueTable` is ``emg_torque``."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__.removesuffix("Table")).lower()

    def reads(self, channel: str, stream: str) -> bool:
        """Return whether spikes in a channel would spoil the result; `stream` is "" for the recording's own file."""
        return False

    def max_interpolated_gap(self, stream: str, channels: Collection[str]) -> float:
        """Return the longest gap over which the procedure interpolates without loss [s].

        It is that of a stream with these channels; "" is the recording's own file.
        """
        return 0.0

    def named_files(self) -> tuple[str, ...]:
        """Return the files that the table names, relative to the study's folder."""
        return ()

    def require_in(self, config: Any) -> None:
        """Raise a ValueError if the table refers to something that is missing in the rest of study.toml."""


Table = TypeVar("Table", bound=ProcedureTable)
"""The class of a table that asks for a procedure."""


def quantity(expected: str, **bounds: float) -> Any:
    """Return the type of a field written as ``"1.5 V"``; an expected unit in <> is looked up among the rig's units."""

    def convert(value: Any, info: ValidationInfo) -> float | None:
        if value is None:
            return None
        units = info.context or {}
        unit = units.get(expected, expected) if expected.startswith("<") else expected
        return parse_quantity(value, unit, "")

    convert_text = BeforeValidator(convert, json_schema_input_type=str)
    return Annotated[float, Field(**bounds), convert_text, Field(description=f"number and unit ({expected})")]
