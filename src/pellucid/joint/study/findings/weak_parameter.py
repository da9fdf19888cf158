"""Finding: a parameter is not identified, because it is on a bound, not different from 0, or hidden by another."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....models.friction_terms import TERMS
from ....models.parameter import Verdict
from ...fit.joint_estimate import JointEstimate
from ..joint_case import JointCase

WEAKNESS_REASONS = {
    "inertia": "it hardly accelerates",
    "gravity": "it hardly leaves its resting angle",
    "gravity_cosine": "its range of angles is too small",
    "offset": "friction in the two directions hides it",
} | {term.name: term.weak_because for term in TERMS}
"""Reason why recordings may not show a parameter; ``{speed}`` is the largest recorded speed."""

DEFAULT_REASON = "it never moves faster than {speed}"
"""Reason for a parameter without one of its own."""

ADVICE_BY_PARAMETER = {
    "inertia": "Record quick reversals too: steps, or a motion of several frequencies.",
    "gravity": "Record over a wider range of angles.",
    "gravity_cosine": "Record over a wider range of angles.",
    "offset": "Record both directions over the same positions.",
} | {term.name: term.advice for term in TERMS}
"""Recordings to make so that a parameter is identified."""

MAX_FIT_ERROR_PERCENT = 20.0
"""If the error of the fit exceeds this [%], the model is to blame for a weak parameter and not the motion."""

MIN_STANDARD_ERRORS = 1.96
"""A parameter differs from 0 statistically by more than this many standard errors."""

NEGLIGIBLE_EFFORT_SHARE = 0.05
"""A parameter is negligible if half the width of its interval changes the effort by less than this share (RMS)."""

MIN_HIDING_CORRELATION = 0.9
"""A parameter is hidden by another if the correlation of their estimates exceeds this."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report each parameter of the best family that is on its bound or not different from zero."""
    top = max(float(np.abs(m.velocity).max()) for m in case.data.motions)
    speed = f"{np.degrees(top):.3g} deg/s" if case.rotary else f"{top:.3g} m/s"
    estimate = case.fit.headline.estimate
    for parameter in estimate.parameters:
        name = parameter.name.replace("_", " ")
        if parameter.influence == 0.0:
            continue  # without a Stribeck level the Stribeck velocity has no effect
        if parameter.at_bound:
            yield Verdict(
                "note",
                f"{name} is held at its physical bound ({parameter.value:.3g} {parameter.unit}): there is none to "
                "see, or the model misses something that pushes it there.",
            )
        elif not parameter.identifiable and abs(parameter.value) < MIN_STANDARD_ERRORS * parameter.statistical_error:
            # A neglected effect may also widen an interval; the motion is then not to blame.
            low, high = parameter.interval(case.level)
            if 0.5 * (high - low) * parameter.influence < NEGLIGIBLE_EFFORT_SHARE:
                yield Verdict(
                    "note",
                    f"{name} is indistinguishable from zero: at most {max(abs(low), abs(high)):.2g} "
                    f"{parameter.unit}, too little to matter.",
                )
                continue
            missed = case.fit.fitted_effort_error
            why = _rival(estimate, parameter.name)
            if why is None and missed > MAX_FIT_ERROR_PERCENT:
                why = f"the model misses {missed:.2g} % of the effort, in which it drowns"
            why = why or WEAKNESS_REASONS.get(parameter.name, DEFAULT_REASON).format(speed=speed)
            yield Verdict(
                "warning",
                f"{name} is not identifiable from these recordings: {why} (interval {low:.3g} to {high:.3g} "
                f"{parameter.unit}).",
                "" if "drowns" in why else advice(parameter.name),
            )


def advice(name: str) -> str:
    """Return what to record so that a parameter shows; empty for one that has no advice."""
    return ADVICE_BY_PARAMETER.get(name, "")


def _rival(estimate: JointEstimate, name: str) -> str | None:
    """Return the parameter that hides another one, if their estimates are nearly proportional."""
    names = [p.name for p in estimate.parameters]
    sd = np.sqrt(np.diag(estimate.covariance))
    i = names.index(name)
    correlation = estimate.covariance[i] / np.maximum(sd * sd[i], np.finfo(float).tiny)
    correlation[i] = 0.0
    j = int(np.argmax(np.abs(correlation)))
    if abs(correlation[j]) < MIN_HIDING_CORRELATION:
        return None
    return f"it trades off against {names[j].replace('_', ' ')} (correlation {correlation[j]:+.2f})"
