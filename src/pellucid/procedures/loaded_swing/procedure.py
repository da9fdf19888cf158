"""An exoskeleton's swings, empty and with relaxed legs in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pydantic import Field

from ...studies.study_fields import ProcedureTable, quantity
from ..procedure import Procedure, Progress, quiet

if TYPE_CHECKING:
    from ...pages.page import Page
    from ...recordings.fault import Fault
    from ...studies.study import Study
    from .identify_loaded_swing import LoadedSwingResult


class LoadedSwingTable(ProcedureTable):
    """An exoskeleton's swings, empty and with relaxed legs in it: ``[loaded_swing]``.

    Attributes
    ----------
    lowpass : float
        Cut-off of the zero-phase low-pass on position and torque [Hz].
    confidence : float
        Of the intervals, in (0, 1).
    """

    alone: ClassVar[bool] = True

    lowpass: quantity("Hz", gt=0) = 4.0
    confidence: float = Field(0.95, gt=0, lt=1)

    bridges: ClassVar[bool] = False

    def reads(self, channel: str, stream: str) -> bool:
        """Position and torque."""
        return not stream and channel in ("position", "torque")


class LoadedSwingProcedure(Procedure[LoadedSwingTable, "LoadedSwingResult"]):
    """An exoskeleton's swings, empty and with relaxed legs in it."""

    name, command = "loaded_swing", "identify"
    table = LoadedSwingTable

    def faults(self, study: Study, table: LoadedSwingTable) -> list[Fault]:
        from .identify_loaded_swing import faults

        return faults(study)

    def run(self, study: Study, table: LoadedSwingTable, tell: Progress = quiet) -> LoadedSwingResult:
        from .identify_loaded_swing import identify_loaded_swing

        return identify_loaded_swing(study, tell)

    def page(self, study: Study, found: LoadedSwingResult) -> Page:
        from .loaded_swing_page import page

        return page(study, found)
