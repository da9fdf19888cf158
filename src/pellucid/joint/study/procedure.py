"""A joint with friction, driven by a motor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...study.procedures.procedure import Procedure, Progress, quiet
from ...study.study import Study

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...files.fault import Fault
    from ...study.pages.page import Page
    from .joint_result import JointResult
    from .spring_result import SpringResult
    from .static_postures import PostureResult


class JointProcedure(Procedure[None, "JointResult | PostureResult | SpringResult"]):
    """A joint with friction, driven by a motor."""

    name, command = "joint", "identify"
    takes_families = True

    def faults(self, study: Study, table: None) -> list[Fault]:
        from .held_joint import is_held_throughout, is_locked_spring, with_spring_advice
        from .joint_faults import joint_faults

        if is_locked_spring(study):
            from .spring_recordings import spring_faults

            return spring_faults(study)
        if is_held_throughout(study):
            from .static_postures import posture_faults

            return with_spring_advice(study, posture_faults(study))
        return with_spring_advice(study, joint_faults(study))

    def run(
        self,
        study: Study,
        table: None,
        tell: Progress = quiet,
        *,
        families: Sequence[str] | None = None,
        thorough: bool = True,
    ) -> JointResult | PostureResult | SpringResult:
        from ..._errors import IdentificationError
        from .held_joint import is_held_throughout, is_locked_spring, spring_advice
        from .identify_joint import identify_joint

        if is_locked_spring(study):
            from .spring_recordings import identify_spring

            return identify_spring(study)
        try:
            if is_held_throughout(study):
                from .static_postures import identify_postures

                return identify_postures(study)
            return identify_joint(study, tell, families=families, thorough=thorough)
        except IdentificationError as error:
            advice = spring_advice(study)
            if not advice:
                raise
            raise IdentificationError(f"{error}; {advice}") from error

    def page(self, study: Study, found: JointResult | PostureResult | SpringResult) -> Page:
        from .joint_page import page
        from .spring_recordings import spring_page
        from .spring_result import SpringResult
        from .static_postures import PostureResult, posture_page

        if isinstance(found, SpringResult):
            return spring_page(study, found)
        if isinstance(found, PostureResult):
            return posture_page(study, found)
        return page(study, found)

    def cut(self, study: Study) -> list[Fault]:
        """Return the cuts, the stretches that are too short, and the notes on clocks."""
        from ...study.quality import clock_faults
        from ...study.recorded_motions import short_stretch_faults

        clocks = (fault for recording in study.recordings() for fault in clock_faults(recording, study))
        return [*super().cut(study), *short_stretch_faults(study), *clocks]

    def unfit(self, study: Study) -> dict[str, Fault]:
        """Return nothing, because a recording with too many cuts refuses the whole study."""
        return {}

    def asked(self, study: Study) -> bool:
        alone = any(table.alone for table in study.config.procedures.values())
        return not alone and study.rig.drive is not None and study.rig.slider is None
