"""Finding: somebody wears the joint, or its effort is its own command."""

from __future__ import annotations

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ....recordings.defects import worn
from ..joint_case import JointCase
from ..wearer import WORN_ADVICE, wearer_faults

WORN_WEIGHT = 1e6
"""Weight of this verdict, which stands before all others of its kind."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report that a recording was worn, which makes every parameter one of robot and wearer together."""
    for fault in wearer_faults(case.study):
        if fault.kind == worn.KIND:
            text = (
                f"Somebody seems to wear the joint in {fault.file}: {fault.found}. No delay was moved on its account."
            )
            yield Verdict("warning", text, f"{WORN_ADVICE}.", weight=WORN_WEIGHT)
        else:
            text = f"{fault.channel} of {fault.file} is no measurement: {fault.found}."
            do = "Log what the drive's current or a torque sensor measured."
            yield Verdict("warning", text, do, weight=WORN_WEIGHT)
