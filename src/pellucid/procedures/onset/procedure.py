"""Procedure that finds the onsets and durations of muscle activity in raw EMG."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from ...studies.study_fields import quantity
from ..muscle_tables import MuscleTable
from ..procedure import Procedure, Progress, quiet

if TYPE_CHECKING:
    from ...pages.page import Page
    from ...recordings.fault import Fault
    from ...studies.study import Study
    from .find_onsets import OnsetResult


class OnsetTable(MuscleTable):
    """Settings of onset detection: ``[onset]``.

    Attributes
    ----------
    rest : tuple of float or None
        Beginning and end of the rest in every recording [s]; by default the quietest half second of each muscle.
    height : float
        Threshold of the energy above its mean at rest, in standard deviations of rest.
    shortest : float
        Shortest time for which the energy must exceed the threshold [s].
    pause : float
        Shortest pause between two bursts [s]; shorter pauses are within one burst.
    confidence : float
        Confidence level of the intervals, in (0, 1).
    """

    rest: tuple[quantity("s"), quantity("s")] | None = None
    height: float = Field(15.0, gt=0)
    shortest: quantity("s", gt=0) = 0.025
    pause: quantity("s", ge=0) = 0.1
    confidence: float = Field(0.95, gt=0, lt=1)


class OnsetProcedure(Procedure[OnsetTable, "OnsetResult"]):
    """Onsets of muscle activity."""

    name, command = "onset", "onset"
    table = OnsetTable
    whole = True

    def faults(self, study: Study, table: OnsetTable) -> list[Fault]:
        from .find_onsets import faults

        return faults(study, table)

    def run(self, study: Study, table: OnsetTable, tell: Progress = quiet) -> OnsetResult:
        from .find_onsets import find_onsets

        return find_onsets(study, table, tell)

    def page(self, study: Study, found: OnsetResult) -> Page:
        from .onset_page import page

        return page(study, found)
