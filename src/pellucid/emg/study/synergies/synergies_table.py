"""Table ``[synergies]`` of study.toml."""

from __future__ import annotations

from pydantic import Field

from ..muscle_tables import EnvelopeTable


class SynergiesTable(EnvelopeTable):
    """Settings of muscle synergies: ``[synergies]``.

    Attributes
    ----------
    number : int or None
        Number of synergies; by default the smallest that predicts each muscle from the others on held-out samples
        as well as any, within one standard error.
    most : int
        Largest number of synergies that is tried.
    """

    number: int | None = Field(None, ge=1, le=30)
    most: int = Field(8, ge=1, le=30)
