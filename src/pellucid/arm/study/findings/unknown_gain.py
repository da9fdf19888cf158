"""Finding: the gain of a drive is unknown, so its joint's parameters are per ampere or per volt."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..tree_result import TreeResult


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the drives with unknown gains."""
    unknown = [joint for joint, (_, _, known) in zip(case.names, case.gains, strict=True) if not known]
    if unknown:
        several = len(case.names) > 1
        yield Verdict(
            "warning" if several else "note",
            f"Gains of the drives of {', '.join(unknown)} are not known: numbers of these joints are per unit of the "
            "drive, and say nothing of newton metres."
            + (" Joints that carry the same bodies are fitted as if their gains were alike." if several else ""),
            'Write a torque_constant in [rig.joints.drive], or [tree] gains = "desired" or "payload".',
        )
