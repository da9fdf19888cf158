"""Table ``[cocontraction]`` of study.toml."""

from __future__ import annotations

from pydantic import Field

from ....study.study_fields import Word
from ..muscle_tables import EnvelopeTable


class CocontractionTable(EnvelopeTable):
    """Settings of co-contraction: ``[cocontraction]``.

    Attributes
    ----------
    pairs : tuple of (str, str)
        Antagonists, by the names of their channels ``emg.<muscle>``.
    confidence : float
        Confidence level of the intervals, in (0, 1).
    """

    pairs: tuple[tuple[Word, Word], ...] = Field(min_length=1)
    confidence: float = Field(0.95, gt=0, lt=1)
