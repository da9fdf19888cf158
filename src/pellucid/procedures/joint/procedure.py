"""A joint with friction, driven by a motor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...recordings.study import Study
from ..procedure import Procedure, late

if TYPE_CHECKING:
    from ...recordings.fault import Fault


class JointProcedure(Procedure):
    """A joint with friction, driven by a motor."""

    name, command = "joint", "identify"
    faults = late("joint.joint_faults", "joint_faults")
    run = late("joint.identify_joint", "identify_joint")
    page = late("joint.joint_page", "page")

    def cut(self, study: Study) -> list[Fault]:
        """Cuts, what between them is too short, and what was made of clocks."""
        from ...recordings.quality import clock_faults
        from .recorded_motions import left_out

        clocks = (fault for recording in study.recordings() for fault in clock_faults(recording, study))
        return [*super().cut(study), *left_out(study), *clocks]

    def unfit(self, study: Study) -> dict[str, Fault]:
        """None: a recording of which too much is cut refuses the study."""
        return {}

    def asked(self, study: Study) -> bool:
        alone = any(table.alone for table in study.config.procedures.values())
        return not alone and study.rig.drive is not None and study.rig.slider is None
