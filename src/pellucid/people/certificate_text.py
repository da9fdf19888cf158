"""What a certificate says in words: changes, intervals, shares of people, tipping points and reasons.

Terminal, page, table and notebook all take these words from here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .equivalence import BEYOND_MARGIN, MAX_TIPPING_POINT, Equivalence
from .indices import PERCENTAGE_POINTS
from .share_of_people import DEFAULT_RULE, MIN_PEOPLE, NOT_SHOWN, TOO_FEW, ShareRule, ShareTest

if TYPE_CHECKING:
    from .analysis import EndPoint


def lowered(words: str) -> str:
    """Return words as they stand within a sentence; an abbreviation keeps its capitals."""
    return words if words[:2].isupper() else words[:1].lower() + words[1:]


def change_figure(value: float, unit: str) -> str:
    """Return a change, or an end of its interval, with the digits that every part of a report gives it."""
    if unit not in ("%", PERCENTAGE_POINTS):
        return f"{value:+.3g}"
    return f"{value:+.0f}" if abs(value) >= 100.0 else f"{round(value, 1) + 0.0:+.1f}"  # 0 has no minus sign


def signed_text(point: EndPoint, value: float) -> str:
    """Return a difference with its sign, in the unit that reports show."""
    return change_figure(point.shown(value), point.unit)


def change_text(point: EndPoint, test: Equivalence) -> str:
    """Return the change of an end point with its unit."""
    if not np.isfinite(test.estimate):
        return "not known"
    least = "at least " if test.bounded and np.isfinite(test.differences).all() else ""
    return f"{least}{signed_text(point, test.estimate)} {point.unit}".strip()


def interval_text(point: EndPoint, test: Equivalence) -> str:
    """Return the interval of a change without its unit, or why there is none."""
    low, high = test.interval
    if not np.isfinite(low) and not np.isfinite(high):
        return "none: too few people" if not test.bounded else "none: cut off"
    if not np.isfinite(low):
        return f"below {signed_text(point, high)}"
    if not np.isfinite(high):
        return f"above {signed_text(point, low)}"
    return f"{signed_text(point, low)} to {signed_text(point, high)}"


def interval_with_unit(point: EndPoint, test: Equivalence) -> str:
    """Return the interval of a change with its unit."""
    return f"{interval_text(point, test)} {point.unit}".rstrip()


def margin_text(point: EndPoint, test: Equivalence) -> str:
    """Return the margin with its unit, and how much of it the largest carry-over leaves for the interval."""
    return f"{_margin_ends(point, test, 0.0)} {point.unit}".rstrip() + carry_over_note(point, test)


def carry_over_note(point: EndPoint, test: Equivalence) -> str:
    """Return in brackets what the largest carry-over leaves of the margin; "" if it takes nothing."""
    return f" ({_margin_ends(point, test, test.allowance)} after carry-over)" if test.allowance else ""


def _margin_ends(point: EndPoint, test: Equivalence, allowed: float) -> str:
    pair = (test.margin.low + allowed, test.margin.high - allowed)
    return " to ".join("none" if np.isinf(end) else signed_text(point, end) for end in pair)


def share_text(percent: float) -> str:
    """Return a bound of a share [%] that is never rounded to none or to all.

    >>> share_text(0.4), share_text(83.2), share_text(99.98)
    ('< 1 %', '83 %', '> 99 %')
    """
    if 0.0 < percent < 1.0:
        return "< 1 %"
    return "> 99 %" if 99.0 < percent < 100.0 else f"{percent:.0f} %"


def interval_level(alpha: float) -> str:
    """Return the level of an equivalence test's intervals: two one-sided tests leave out alpha at each end.

    >>> interval_level(0.05)
    '90 %'
    """
    return f"{100.0 * (1.0 - 2.0 * alpha):g} %"


def p_text(p: float) -> str:
    """Return a p value as tables have it."""
    return "< 0.001" if p < 0.001 else f"{p:.2g}"


def p_statement(p: float) -> str:
    """Return a p value as a sentence has it."""
    return "p < 0.001" if p < 1e-3 else f"p = {p:.3f}"


def people_text(shares: ShareTest) -> str:
    """Say how many people lie within, and what the bounds of both shares are."""
    counted = f"{shares.within} of {shares.people} within"
    if shares.answer == TOO_FEW:
        return f"{counted}: too few"
    far = f"at most {share_text(100.0 * shares.most_far)} beyond {shares.rule.far_margins:g} margins"
    return f"{counted}: at least {share_text(100.0 * shares.least_within)}; {far}"


def tipping_text(tipping_point: float | None, test: Equivalence) -> str:
    """Say how large a carry-over, in margins, would overturn what is said of an end point."""
    if tipping_point is not None:
        most = tipping_point > MAX_TIPPING_POINT - 0.1
        return f"none up to {MAX_TIPPING_POINT:g} margins" if most else f"over {tipping_point:.2f} margins"
    return "sessions not ordered" if test.sessions is None else "nothing is claimed"


def undecided_reason(point: EndPoint, test: Equivalence, rule: ShareRule = DEFAULT_RULE) -> str:
    """Return why a test claims neither "within" nor "beyond", by the rule that decided."""
    (low, high), n, unit = test.interval, test.pairs, f" {point.unit}".rstrip()
    if test.verdict == BEYOND_MARGIN:
        return f"beyond the margin if tested alone, with {n} people; among several end points this may be chance"
    reasons = []
    allowed = test.allowance
    if not np.isfinite([low, high]).all():
        reasons.append(f"the change has no finite interval with {n} people")
    elif low - allowed <= test.margin.low or high + allowed >= test.margin.high:
        ends = [signed_text(point, end) for end in (low - allowed, high + allowed)]
        margin = ["none" if np.isinf(end) else signed_text(point, end) for end in (test.margin.low, test.margin.high)]
        more = f" with a carry-over of up to {test.largest_carry_over:g} margins" if allowed else ""
        reasons.append(
            f"the {interval_level(test.alpha)} interval of {n} people{more}, {ends[0]} to {ends[1]}{unit}, "
            f"extends beyond the margin, {margin[0]} to {margin[1]}{unit}"
        )
    shares = test.share_test(rule)
    if shares.far:
        lie = "lies" if shares.far == 1 else "lie"
        reasons.append(f"{shares.far} of {n} people {lie} beyond {rule.far_margins:g} margins")
    if shares.answer == TOO_FEW:
        reasons.append(f"too few participants: {n} took part, and a claim needs at least {MIN_PEOPLE}")
    elif shares.answer == NOT_SHOWN and not reasons:
        reasons.append(share_reason(shares))
    return "; ".join(reasons)


def share_reason(shares: ShareTest) -> str:
    """Return which share of people is not shown, with its bound."""
    rule, level = shares.rule, f"{100.0 * (1.0 - shares.rule.alpha):g} % confidence"
    reasons = []
    if shares.p_within > rule.alpha:
        reasons.append(
            f"{shares.within} of {shares.people} people are within the margin{shares.noise_note}, which shows this for "
            f"at least {100.0 * shares.least_within:.0f} % of people ({level}); {100.0 * rule.within:g} % are required"
        )
    if shares.p_far > rule.alpha:
        reasons.append(
            f"{shares.far} of {shares.people} people are beyond {rule.far_margins:g} margins; up to "
            f"{100.0 * shares.most_far:.0f} % of people may be ({level}); at most {100.0 * rule.far:g} % are allowed"
        )
    return "; ".join(reasons)
