"""Finding: the presliding travel, measured, bounded or unknown."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..joint_case import JointCase

RECORDING_ADVICE = (
    "Before dither or a law that acts near standstill is used, record small slow reversals of growing size around "
    "several angles. The command `protocol` writes such a motion by the name reversals."
)
"""Advice if no recording shows the travel before friction slips."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the presliding travel, and its effect on the prediction of held-out effort."""
    found = case.presliding
    if found is None:
        return
    unit = "mrad" if case.rotary else "mm"
    if found.travel is not None:
        low, high = found.travel.interval(case.level)
        text = (
            f"Friction builds up over {1e3 * found.travel.value:.3g} {unit} before the joint slips ({1e3 * low:.3g} to "
            f"{1e3 * high:.3g}, {100 * case.level:g} %)"
        )
        if case.judged_on_held_out:
            text += (
                f": over slow samples too, effort that was not fitted is predicted to {found.gives:.3g} "
                f"{case.fit.model.effort_unit} RMS, to {found.slips:.3g} if it slips at once"
            )
        yield Verdict("note", f"{text}.")
    elif found.below is not None:
        yield Verdict(
            "note",
            f"If friction builds up before the joint slips, then over less than {1e3 * found.below:.2g} {unit}: "
            f"{found.why}.",
        )
    else:
        yield Verdict(
            "note",
            f"It is unknown over which way friction builds up before the joint slips: {found.why}.",
            RECORDING_ADVICE,
        )
