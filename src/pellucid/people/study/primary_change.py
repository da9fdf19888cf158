"""The primary change of each index from control: the one number that tile, headline, text and certificate tell.

It is the study's estimand: the mean of people's own changes, or their pseudo-median, without the effects of periods
where sessions came in an order. Changes of an index with a zero are ratios, so that their mean is a geometric one; an
index with a stated margin is compared as the margin is. Whatever
else describes a change (the change of the mean, the mixed model, other filters) is a sensitivity analysis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import ESTIMAND_METHODS, EndPoint, Estimand
from ..certificate_text import change_figure
from ..equivalence import Margin, equivalence
from ..indices import CutOff
from ..movement_indices import IndexTable
from ..session_periods import SessionPeriods

if TYPE_CHECKING:
    from .assessment_result import AssessmentResult

ESTIMAND_WORDS: dict[Estimand, str] = {
    "mean": "mean of people's own changes",
    "pseudo-median": "pseudo-median of people's own changes",
    "mean and people": "mean of people's own changes",
}
"""Words for the estimates."""


@dataclass(frozen=True)
class PrimaryChange:
    """Change of an index from control under a condition, as every part of a report tells it."""

    value: float  # in % of control, or in the unit of tables; NaN if movements were cut off, so that it is not known
    low: float  # interval of the study's confidence; NaN with one participant
    high: float
    unit: str  # ``"%"`` or the unit of tables
    at_least: bool = False  # whether the value is a lower bound, because somebody's movements were cut off

    @property
    def text(self) -> str:
        """The change with its sign and unit, as headline, tile, text and tables tell it."""
        return f"{self.figure} {self.unit}".rstrip() if np.isfinite(self.value) else "not known"

    @property
    def figure(self) -> str:
        """The change with its sign, without its unit."""
        return ("at least " if self.at_least else "") + change_figure(self.value, self.unit)

    @property
    def excludes_zero(self) -> bool | None:
        """Whether the interval excludes no change; None without an interval."""
        return None if not self.interval else not self.low <= 0.0 <= self.high

    @property
    def interval(self) -> str:
        """The interval without its unit; "" where there is none."""
        if not (np.isfinite(self.value) and np.isfinite(self.low) and np.isfinite(self.high)):
            return ""
        return f"{change_figure(self.low, self.unit)} to {change_figure(self.high, self.unit)}"


def primary_change(found: AssessmentResult, name: str, condition: str) -> PrimaryChange | None:
    """Return the primary change of an index under a condition; None if it has no control to change from."""
    named = (each for each in found.certified if each.condition == condition and name in each.end_points)
    certified = next(named, None)
    level = 0.5 * (1.0 - found.confidence)
    if certified is not None:
        point, own = certified.end_points[name], certified.certificate.end_points[name]
        again = own.tested_again(alpha=level)
        bounded = bool(own.bounded and np.isfinite(own.differences).all())
        ends = (point.shown(end) for end in again.interval)
        return PrimaryChange(point.shown(own.estimate), *ends, point.unit, bounded)
    table = found.assessed[name].table
    change = change_of_table(table, condition, found.control, found.estimand, level, found.sessions(table, condition))
    above, below = found.unreached.get(condition, (False, False))
    if change is None or table.index.cut_off is not CutOff.AT_LEAST_SEEN or not (above or below):
        return change
    # A median that was not reached in the condition leaves a lower bound, in control none.
    return replace(change, value=nan if below else change.value, low=nan, high=nan, at_least=not below)


def change_of_table(
    table: IndexTable, condition: str, control: str, estimand: Estimand, level: float = 0.025,
    sessions: SessionPeriods | None = None,
) -> PrimaryChange | None:
    """Return the change that a table's participants show; None without values of the condition or of control.

    With `sessions` it is that without the effects of the periods.
    """
    if condition not in table.conditions or condition == control:
        return None
    own, index = table.column(condition), table.index
    base = None if index.over_control else table.column(control) if control in table.conditions else None
    if base is None and not index.over_control:
        return None
    ratio = index.scaled and base is not None and bool((own > 0.0).all() and (base > 0.0).all())
    point = EndPoint(index.name, index.along, "", Margin.either_way(1.0), ratio)
    d = point.differences(own, base)
    if len(d) < 2:
        return PrimaryChange(point.shown(float(d[0])), nan, nan, point.unit)
    tested = equivalence(d, point.margin, alpha=level, method=ESTIMAND_METHODS[estimand], sessions=sessions)
    low, high = (point.shown(end) if np.isfinite(end) else nan for end in tested.interval)
    return PrimaryChange(point.shown(tested.estimate), low, high, point.unit)
