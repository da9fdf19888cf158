"""A wearer strapped to an orthosis: both bodies, and what couples them."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from ...studies.study_fields import ProcedureTable, Word
from ..procedure import Procedure, Progress, quiet

if TYPE_CHECKING:
    from ...pages.page import Page
    from ...recordings.fault import Fault
    from ...studies.study import Study
    from .coupling_result import CouplingResult


class CouplingTable(ProcedureTable):
    """A wearer strapped to an orthosis: ``[coupling]``.

    Attributes
    ----------
    imu, emg : str
        Streams of the limb's IMU and of the muscles.
    orientation : str
        Filter of the IMU: ``"vqf"`` or ``"madgwick"``.
    magnetometer : bool
        Whether it is used.
    confidence : float
        Of the intervals, in (0, 1).
    posterior : bool
        Whether a posterior of each strap is drawn beside its intervals.
    """

    alone: ClassVar[bool] = True

    imu: Word = "imu"
    emg: Word = "emg"
    orientation: Literal["vqf", "madgwick"] = "vqf"
    magnetometer: bool = True
    confidence: float = Field(0.95, gt=0, lt=1)
    posterior: bool = False

    def reads(self, channel: str, stream: str) -> bool:
        """Torque and angle of the orthosis, and the limb's IMU."""
        return stream == self.imu if stream else channel in ("torque", "position")


class CouplingProcedure(Procedure[CouplingTable, "CouplingResult"]):
    """A wearer strapped to an orthosis: both bodies, and what couples them."""

    name, command = "coupling", "identify"
    table = CouplingTable

    def faults(self, study: Study, table: CouplingTable) -> list[Fault]:
        from .identify_coupling import faults

        return faults(study)

    def run(self, study: Study, table: CouplingTable, tell: Progress = quiet) -> CouplingResult:
        from .identify_coupling import identify_coupling

        return identify_coupling(study, tell)

    def page(self, study: Study, found: CouplingResult) -> Page:
        from .coupling_page import page

        return page(study, found)
