"""Procedure that computes indices of co-contraction from envelopes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from ...studies.study_fields import Word
from ..muscle_tables import EnvelopeTable
from ..procedure import Procedure, Progress, quiet

if TYPE_CHECKING:
    from ...pages.page import Page
    from ...recordings.fault import Fault
    from ...studies.study import Study
    from .find_cocontraction import CocontractionResult


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


class CocontractionProcedure(Procedure[CocontractionTable, "CocontractionResult"]):
    """Co-contraction of antagonists."""

    name, command = "cocontraction", "cocontraction"
    table = CocontractionTable
    whole = True

    def faults(self, study: Study, table: CocontractionTable) -> list[Fault]:
        from ..muscle_channels import envelope_faults
        from .find_cocontraction import require_pairs

        return envelope_faults(study, table, lambda made: require_pairs(study, table, made), "antagonists")

    def run(self, study: Study, table: CocontractionTable, tell: Progress = quiet) -> CocontractionResult:
        from .find_cocontraction import find_cocontraction

        return find_cocontraction(study, table, tell)

    def page(self, study: Study, found: CocontractionResult) -> Page:
        from .cocontraction_page import page

        return page(study, found)
