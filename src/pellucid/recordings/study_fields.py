"""What every table of study.toml is made of: quantities with units, and no key that nobody knows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from ..units import parse_quantity

if TYPE_CHECKING:
    from .study_file import StudyFile

NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"
"""What a study's name may look like."""

DERIVED = "\0"
"""What the names of fields begin with that follow from others; no person can write such a key."""


class StudyTable(BaseModel):
    """A table; quantities are SI once it is read."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, hide_input_in_errors=True)


class ProcedureTable(StudyTable):
    """A table of study.toml that asks for a procedure."""

    alone: ClassVar[bool] = False
    """Whether no other such table may stand beside it: each is a study of its own."""

    def require_in(self, config: StudyFile) -> None:
        """Raise ValueError where what the table names is not among the rest of study.toml."""


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
