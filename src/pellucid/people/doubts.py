"""Doubts on the change of an end point: order of conditions, movements that were still changing, lost values.

What tests a study's recordings and what tests a table of values take their doubts from here.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .certificate import Doubt
from .crossover import carry_over, is_balanced, period_effect
from .curves import CurveComparison
from .equivalence import BEYOND_MARGIN, Equivalence, Margin, Method, equivalence
from .mean_test import HIDDEN_SHARE, MIN_PEOPLE
from .signed_rank import signed_rank

PERIOD_DOUBT = "period"
"""Doubt: the period of the session may have changed the end point."""

CARRY_OVER_DOUBT = "carry-over"
"""Doubt: the preceding condition may have changed the end point."""

LEARNING_DOUBT = "learning"
"""Doubt: the end point was still changing during the session."""

LEFT_OUT_DOUBT = "left out"
"""Doubt: failed movements, counted as longer than any other, would change the verdict."""

LOST_MOVEMENTS_DOUBT = "lost movements"
"""Doubt: more movements than `max_left_out` allows gave the end point no value."""

LOST_PEOPLE_DOUBT = "lost people"
"""Doubt: more participants than `max_left_out` allows take no part."""

LostCounts = Mapping[str, tuple[int, int]]
"""Number of movements without a value, and of all movements, by condition."""


def period_doubt(
    differences: np.ndarray, later: np.ndarray, margin: Margin, *, alpha: float, method: Method
) -> Doubt | None:
    """Return the doubt that the period changed an end point; None if that cannot be told from the change itself.

    `differences` (n,); `later`, (n,), is by how many periods each came after control.
    """
    effect = period_effect(differences, later, margin, alpha=alpha, method=method)
    if effect is None:
        return None
    balanced = is_balanced(later)
    return Doubt(PERIOD_DOUBT, effect.p_value, effect.without, always=not balanced, never=balanced)


def carry_over_doubt(
    values: np.ndarray, periods: np.ndarray, control: int, compared: int, margin: Margin, *, alpha: float
) -> Doubt | None:
    """Return the doubt that the condition before changed an end point; None if that cannot be told.

    `values` and `periods`, (n, k); `control` and `compared` are columns.
    """
    lingers = carry_over(values, periods, control, compared, margin, alpha=alpha)
    return None if lingers is None else Doubt(CARRY_OVER_DOUBT, lingers.p_value, lingers.without)


def learning_doubt(drift: np.ndarray, at_end: np.ndarray, margin: Margin, *, alpha: float, method: Method) -> Doubt:
    """Return the doubt that movements were still changing.

    `drift`, (n,), is each person's change from the first to the last third; `at_end`, (n,), the differences with the
    last third in the place of all.
    """
    p = signed_rank(drift).p_value
    return Doubt(LEARNING_DOUBT, p, equivalence(at_end, margin, alpha=alpha, method=method))


def too_many_lost(lost: LostCounts, max_share: float) -> dict[str, tuple[int, int]]:
    """Return the conditions that lost more than a share `max_share` of their movements, with both counts."""
    return {condition: (gone, of) for condition, (gone, of) in lost.items() if gone > max_share * of}


def doubts_of_loss(
    tests: Mapping[str, Equivalence | CurveComparison], lost: Mapping[str, LostCounts], alpha: float, max_share: float,
    losers: Mapping[str, np.ndarray], method: Method, *, alike: bool = True,
) -> dict[str, Doubt]:  # fmt: skip
    """Return a doubt for each end point within its margin of which too many movements were lost.

    Nothing is known of the changes of people who lost movements (`losers`). Signed ranks of the others may still show
    the pseudo-median to lie within; a mean has no bound then. A claim of "beyond" is not affected where the movements
    that are left are compared with `alike` ones; otherwise it is doubted, too.
    """
    made = {}
    for name, test in tests.items():
        if (test.p_within <= alpha or not alike) and too_many_lost(lost[name], max_share):
            bounded = _without_knowing(test, losers.get(name), alpha, method)
            made[name] = Doubt(LOST_MOVEMENTS_DOUBT, float("nan"), bounded, always=True)
    return made


def doubts_of_lost_people(
    tests: Mapping[str, Equivalence | CurveComparison], count: int, alpha: float, max_share: float, method: Method
) -> dict[str, Doubt]:
    """Return a doubt for each end point within its margin if a `count` of participants, too many, take no part."""
    made = {}
    for name, test in tests.items():
        n = len(test.differences) if isinstance(test, Equivalence) else 0
        if test.p_within <= alpha and count > max_share * (n + count):
            hidden = np.concatenate([np.zeros(n, bool), np.ones(count, bool)]) if n else None
            bounded = _without_knowing(test, hidden, alpha, method)
            made[name] = Doubt(LOST_PEOPLE_DOUBT, float("nan"), bounded, always=True)
    return made


def undecided_reason(test: Equivalence) -> str:
    """Return why a test of logarithms of ratios claims neither "within" nor "beyond", by the rule that decided."""
    (low, high), n = test.interval, test.pairs
    if test.verdict == BEYOND_MARGIN:
        return f"beyond the margin if tested alone, with {n} people; of several end points one may be so by chance"
    reasons = []
    if not np.isfinite([low, high]).all():
        reasons.append(f"the change has no bounds with {n} people")
    elif low <= test.margin.low or high >= test.margin.high:
        ends, margin = (100.0 * np.expm1(pair) for pair in ((low, high), (test.margin.low, test.margin.high)))
        reasons.append(
            f"the {100.0 * (1.0 - 2.0 * test.alpha):g} % interval of {n} people, {ends[0]:+.1f} to {ends[1]:+.1f} %, "
            f"reaches past an end of the margin, {margin[0]:+.1f} to {margin[1]:+.1f} %"
        )
    if test.method == "skew_robust" and n < MIN_PEOPLE:
        reasons.append(f"{n} people took part, and a mean is said to lie within a margin from {MIN_PEOPLE} people on")
    elif test.method == "skew_robust" and not reasons:
        reasons.append(f"with {n} people the {100.0 * HIDDEN_SHARE:g} % who lie farthest away may not have been seen")
    return "; ".join(reasons)


def _without_knowing(
    test: Equivalence | CurveComparison, hidden: np.ndarray | None, alpha: float, method: Method
) -> Equivalence:
    """Return the test with the differences of `hidden` people unknown; of a curve nothing is known then."""
    if hidden is None or not isinstance(test, Equivalence):
        low, high, margin = np.full(2, -np.inf), np.full(2, np.inf), Margin.either_way(1.0)
    else:
        more, margin = np.zeros(len(hidden) - len(test.differences)), test.margin
        low = np.where(hidden, -np.inf, np.concatenate([test.differences, more]))
        upper = test.differences if test.upper is None else test.upper
        high = np.where(hidden, np.inf, np.concatenate([upper, more]))
    return equivalence(low, margin, upper=high, alpha=alpha, method=method)
