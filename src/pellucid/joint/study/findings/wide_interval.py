"""Finding: a parameter differs from zero, but its interval is so wide that its value says little."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Parameter, Verdict
from ....study.pages.quantities import number, unit_text
from ...fit.joint_estimate import JointEstimate
from ..joint_case import JointCase
from .weak_parameter import NEGLIGIBLE_EFFORT_SHARE, advice

MAX_HALF_WIDTH_SHARE = 1.0 / 3.0
"""An interval is wide if half of its width exceeds this share of the value."""

BODY_PARAMETERS = ("inertia", "gravity")
"""Parameters that every use of a model reads. A wide interval of theirs is a warning even if it changes little."""

MIN_STATISTICAL_SHARE = 0.7
"""The motion is to blame for a wide interval if coloured residuals alone make at least this share of its width."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the identifiable parameters of the headline whose intervals are wide, in one verdict."""
    estimate = case.fit.headline.estimate
    wide = [p for p in estimate.parameters if _is_wide(p, case.level)]
    if not wide:
        return
    matters = any(
        p.name in BODY_PARAMETERS or _half_width(p, case.level) * p.influence > NEGLIGIBLE_EFFORT_SHARE for p in wide
    )
    said = "; ".join(_sentence(p, case.level, estimate) for p in wide)
    first = min(wide, key=lambda p: p.name not in BODY_PARAMETERS)
    yield Verdict("warning" if matters else "note", f"Known roughly only: {said}.", advice(first.name))


def _half_width(parameter: Parameter, level: float) -> float:
    low, high = parameter.interval(level)
    return 0.5 * (high - low)


def _is_wide(parameter: Parameter, level: float) -> bool:
    """Whether a parameter is told from zero, has an interval to be read, and the interval is wide."""
    read = parameter.identifiable and parameter.trusted and not parameter.at_bound and parameter.influence > 0.0
    return read and _half_width(parameter, level) > MAX_HALF_WIDTH_SHARE * abs(parameter.value)


def _sentence(parameter: Parameter, level: float, estimate: JointEstimate) -> str:
    """Return a parameter with its interval and what widens it, in words."""
    half = _half_width(parameter, level)
    value = f"{number(parameter.value, half)} ± {number(half, digits=2)} {unit_text(parameter.unit)}".rstrip()
    cause = ""
    if estimate.discrepancy is not None and parameter.name in estimate.discrepancy.names:
        cause = estimate.discrepancy.of([parameter.name])[1][0]
    if not cause or parameter.statistical_error > MIN_STATISTICAL_SHARE * parameter.standard_error:
        cause = "the motion hardly shows it"
    else:
        cause = f"{cause} would move it"
    name = parameter.name.replace("_", " ")
    return f"{name} to ± {100.0 * half / abs(parameter.value):.0f} % ({value}; {cause})"
