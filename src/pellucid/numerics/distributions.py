"""Quantiles and tail probabilities that need no SciPy, which takes a third of a second to load."""

from __future__ import annotations

from math import erfc, exp, inf, lgamma, log, sqrt
from statistics import NormalDist

_STANDARD_NORMAL = NormalDist()


def normal_share_below(value: float) -> float:
    """Return the probability that a standard normal variable lies below `value`."""
    return 0.5 * erfc(-value / sqrt(2.0))


def normal_quantile(share: float) -> float:
    """Return the value below which a standard normal variable lies with probability `share`."""
    if 0.0 < share < 1.0:
        return _STANDARD_NORMAL.inv_cdf(share)
    return {0.0: float("-inf"), 1.0: float("inf")}.get(share, float("nan"))


def chi_square_tail(degrees: int, value: float) -> float:
    """Return the probability that a chi-square variable with an integer number of `degrees` exceeds `value`.

    It is a finite sum: of Poisson probabilities for an even number, and with the normal tail for an odd one.
    """
    half = 0.5 * float(value)
    if half <= 0.0 or half == inf:
        return 1.0 if half <= 0.0 else 0.0
    orders = range(degrees // 2) if degrees % 2 == 0 else [i + 0.5 for i in range(degrees // 2)]
    tail = sum(exp(i * log(half) - half - lgamma(i + 1.0)) for i in orders)
    return min(tail + (erfc(sqrt(half)) if degrees % 2 else 0.0), 1.0)
