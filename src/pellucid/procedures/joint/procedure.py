"""A joint with friction, driven by a motor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...studies.study import Study
from ..procedure import Procedure, Progress, quiet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...pages.page import Page
    from ...recordings.fault import Fault
    from .joint_result import JointResult


class JointProcedure(Procedure[None, "JointResult"]):
    """A joint with friction, driven by a motor."""

    name, command = "joint", "identify"
    takes_families = True

    def faults(self, study: Study, table: None) -> list[Fault]:
        from .joint_faults import joint_faults

        return joint_faults(study)

    def run(
        self,
        study: Study,
        table: None,
        tell: Progress = quiet,
        *,
        families: Sequence[str] | None = None,
        thorough: bool = True,
    ) -> JointResult:
        from .identify_joint import identify_joint

        return identify_joint(study, tell, families=families, thorough=thorough)

    def page(self, study: Study, found: JointResult) -> Page:
        from .joint_page import page

        return page(study, found)

    def cut(self, study: Study) -> list[Fault]:
        """Return the cuts, the stretches that are too short, and the notes on clocks."""
        from ...studies.quality import clock_faults
        from .recorded_motions import short_stretch_faults

        clocks = (fault for recording in study.recordings() for fault in clock_faults(recording, study))
        return [*super().cut(study), *short_stretch_faults(study), *clocks]

    def unfit(self, study: Study) -> dict[str, Fault]:
        """Return nothing, because a recording with too many cuts refuses the whole study."""
        return {}

    def asked(self, study: Study) -> bool:
        alone = any(table.alone for table in study.config.procedures.values())
        return not alone and study.rig.drive is not None and study.rig.slider is None
