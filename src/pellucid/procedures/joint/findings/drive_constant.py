"""The drive's constant: found from known payloads, or not known."""

from __future__ import annotations

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """What is known of a drive without a stated constant."""
    drive = case.study.rig.drive
    if drive.kind == "torque" or drive.constant is not None:
        return
    if case.constant is not None:
        low, high = case.constant.interval(case.level)
        yield Verdict(
            "good",
            f"The drive gives {case.constant.value:.4g} {case.constant.unit} (interval {low:.4g} to {high:.4g}), from "
            "the known payloads: put it into study.toml to have results in SI.",
        )
    elif case.no_constant:
        yield Verdict("warning", f"{case.no_constant[0].upper()}{case.no_constant[1:]}.")
    else:
        per = "ampere" if case.fit.model.effort_unit == "A" else "volt"
        yield Verdict(
            "note",
            f"No drive constant is known, so parameters are per {per}: shapes and ratios are meaningful, absolute "
            "masses are not.",
            "A recording with a known payload gives it.",
        )
