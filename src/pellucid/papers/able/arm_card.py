"""The card of a virtual arm as it was identified, without a study."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from ...fit.tree.tree_estimate import TreeEstimate
from ...lab.arm.human_motion import JOINTS
from ...lab.arm.rig import ArmRig
from ...models.tree_card import JointRange, TreeCard


def card_of(rig: ArmRig, estimate: TreeEstimate) -> TreeCard:
    """What a law needs to know of an arm, as it was identified."""

    def table(values: np.ndarray) -> tuple[tuple[float, ...], ...]:
        return tuple(map(tuple, np.asarray(values, float).tolist()))

    tree, said = estimate.robot.tree, [rig["joint"][name] for name in JOINTS]
    ranges = tuple(
        JointRange(s["low"], s["high"], s["velocity"], float(effort), seen_velocity=s["velocity"])
        for s, effort in zip(said, rig.limits, strict=True)
    )
    return TreeCard(
        study=rig.name, family=estimate.name, method=estimate.method, names=JOINTS,
        bodies=tuple(joint.child for joint in tree.order), links=table(estimate.links()), gravity=tree.gravity,
        joints=table(estimate.joints()), turns=table(np.eye(len(JOINTS))), motors=(), gains=tuple(rig.gains.tolist()),
        gains_known=(True,) * 4, drive_units=("A",) * 4, effort_units=("N*m",) * 4, ranges=ranges,
        families=estimate.families, consistent=estimate.name == "consistent", parameters=(), covariance=(),
        heldout_error=(), processing="", confidence=0.95, notes=(), checksums={}, pellucid=version("pellucid"),
    )  # fmt: skip
