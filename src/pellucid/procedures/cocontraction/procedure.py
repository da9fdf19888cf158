"""How much antagonists work against each other, from their envelopes."""

from __future__ import annotations

from pydantic import Field

from ...recordings.study_fields import Word
from ..muscle_tables import EnvelopeTable
from ..procedure import Procedure, late


class CocontractionTable(EnvelopeTable):
    """How much antagonists work against each other: ``[cocontraction]``.

    Attributes
    ----------
    pairs : tuple of (str, str)
        Antagonists, as channels ``emg.<muscle>`` name them.
    confidence : float
        Of the intervals, in (0, 1).
    """

    pairs: tuple[tuple[Word, Word], ...] = Field(min_length=1)
    confidence: float = Field(0.95, gt=0, lt=1)


class CocontractionProcedure(Procedure):
    """How much antagonists work against each other."""

    name, command = "cocontraction", "cocontraction"
    table = CocontractionTable
    whole = True
    faults = late("cocontraction.find_cocontraction", "faults")
    run = late("cocontraction.find_cocontraction", "find_cocontraction")
    page = late("cocontraction.cocontraction_page", "page")
