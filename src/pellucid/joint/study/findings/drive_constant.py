"""Finding: the drive constant from known payloads, compared with the stated one, if any."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.friction_terms import grows_with_load
from ....models.parameter import Verdict
from ..joint_case import JointCase

MIN_STANDARD_ERRORS = 4.0
"""The implied constant contradicts the stated one only if they differ by more than this many standard errors."""

MIN_RELATIVE_DIFFERENCE = 0.1
"""The implied constant contradicts the stated one only if they differ by more than this share."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the drive constant from known payloads, or that it is unknown."""
    drive = case.study.rig.drive
    if drive.kind == "torque" or drive.constant is not None:
        yield from _against_stated(case)
    elif case.constant is not None:
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


def _against_stated(case: JointCase) -> Iterator[Verdict]:
    """Report payloads whose effort contradicts the stated drive constant or sensor."""
    found = case.constant
    if found is None:
        return
    if abs(found.value - _nearest_ratio(case, found.value)) < max(
        MIN_RELATIVE_DIFFERENCE, MIN_STANDARD_ERRORS * found.standard_error
    ):
        return
    low, high = found.interval(case.level)
    drive = case.study.rig.drive
    what = "torque_constant" if case.rotary else "force_constant"
    thousand = any(
        abs(found.value / k - 1.0) < max(MIN_RELATIVE_DIFFERENCE, MIN_STANDARD_ERRORS * found.standard_error / k)
        for k in (1e3, 1e-3)
    )
    if thousand and drive.kind == "current":
        do = "That is the step from A to mA: check the unit of [channels] current."
    elif drive.constant is not None and drive.resistance is None:
        do = f"Check [rig.drive] {what} (the payloads imply {drive.constant * found.value:.4g} instead of "
        do += f"{drive.constant:.4g}), its gear_ratio, the drive's unit, and the payloads."
    else:
        do = "Check the constant, the unit of the channel and the payloads."
    yield Verdict(
        "wrong",
        f"The known payloads imply {found.value:.4g} times the effort that the drive is said to give (interval "
        f"{low:.4g} to {high:.4g}).",
        do,
        weight=12.5,  # more weight than a contradicting recording, which a wrong constant also causes
    )


def _nearest_ratio(case: JointCase, implied: float) -> float:
    """Return the ratio that payloads would imply with a correct constant, as near as possible to `implied`.

    The ratio is 1 without load friction. If the shares of the load lost in motoring and in generating differ by twice
    d, it is 1 / (1 + d), and d is at most their mean.
    """
    model = case.fit.model
    lost = [case.fit[name].value for name in model.names if grows_with_load(name)]
    mean = sum(lost) / len(lost) if lost else 0.0
    largest = 1.0 / (1.0 - mean) if mean < 1.0 else float("inf")
    return min(max(implied, 1.0 / (1.0 + mean)), largest)
