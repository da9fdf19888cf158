"""A hinge between two segments, each with an inertial sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from ...studies.study_fields import ProcedureTable, Word, quantity
from ..procedure import Procedure, Progress, quiet

if TYPE_CHECKING:
    from ...pages.page import Page
    from ...recordings.fault import Fault
    from ...studies.study import Study
    from .identify_hinge import HingeResult


class HingeTable(ProcedureTable):
    """A hinge between two segments, each with an IMU: ``[hinge]``.

    Attributes
    ----------
    proximal, distal : str
        What the names of each IMU's channels begin with.
    calibration : float
        The first seconds, from which axes, joint centre and the angle's zero are found [s].
    score_from : float
        From when on the angle is judged [s].
    jump : float
        A reference angle that changes by more than this from one sample to the next is no measurement [rad].
    delay : float or None
        How much later the IMUs show a motion than the reference does [s]; left out, it is found from the angular rates
        of the calibration's seconds.
    """

    alone: ClassVar[bool] = True

    proximal: Word = "proximal"
    distal: Word = "distal"
    calibration: quantity("s", gt=0) = 10.0
    score_from: quantity("s", ge=0) = 10.0
    jump: quantity("rad", gt=0)
    delay: quantity("s") | None = None

    def reads(self, channel: str, stream: str) -> bool:
        """Rates and accelerations; a reference has a rule of its own for what is no measurement."""
        side, _, what = channel.partition(".")
        measured = what.startswith(("acceleration.", "angular_velocity."))
        return not stream and side in (self.proximal, self.distal) and measured


class HingeProcedure(Procedure[HingeTable, "HingeResult"]):
    """A hinge between two segments, each with an inertial sensor."""

    name, command = "hinge", "identify"
    table = HingeTable

    def faults(self, study: Study, table: HingeTable) -> list[Fault]:
        from .identify_hinge import faults

        return faults(study)

    def run(self, study: Study, table: HingeTable, tell: Progress = quiet) -> HingeResult:
        from .identify_hinge import identify_hinge

        return identify_hinge(study, tell)

    def page(self, study: Study, found: HingeResult) -> Page:
        from .hinge_page import page

        return page(study, found)
