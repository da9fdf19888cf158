"""A joint with friction, driven by a motor."""

from __future__ import annotations

from ...recordings.study import Study
from ..procedure import Procedure, late


class JointProcedure(Procedure):
    """A joint with friction, driven by a motor."""

    name, command = "joint", "identify"
    faults = late("joint.joint_faults", "joint_faults")
    run = late("joint.identify_joint", "identify_joint")
    page = late("joint.joint_page", "page")

    def asked(self, study: Study) -> bool:
        alone = any(table.alone for table in study.config.procedures.values())
        return not alone and study.rig.drive is not None and study.rig.slider is None
