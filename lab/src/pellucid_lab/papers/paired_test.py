r"""What a paired t-test says beyond its p, from printed statistics alone.

A paired t is :math:`t = \bar d \sqrt n / s_d`, so that means and t give the standard deviation of the differences, and
that gives the correlation between both sets:

.. math::
   s_d^2 = s_a^2 + s_b^2 - 2 r s_a s_b
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy import stats

from pellucid._errors import PellucidError


@dataclass(frozen=True)
class PairedTest:
    """What follows from n, both means, both standard deviations, and t."""

    p_value: float  # Two-sided, n - 1 degrees of freedom
    mean_difference: float  # mean_difference, sd_of_differences: In the unit of the means.
    sd_of_differences: float
    correlation: float  # Between both sets; outside [-1, 1] the statistics contradict each other
    effect_size: float  # d_z, mean over standard deviation of the differences
    unpaired_t: float  # What t would be without pairing


def paired_test(t: float, n: int, *, means: tuple[float, float], sds: tuple[float, float]) -> PairedTest:
    """Recompute a paired t-test from its printed numbers."""
    if n < 2 or t == 0.0 or min(sds) <= 0.0:
        raise PellucidError(
            f"paired test: n = {n}, t = {t}, standard deviations {sds}; expected n >= 2, t != 0, both > 0"
        )
    difference = means[0] - means[1]
    sd = abs(difference) * math.sqrt(n) / abs(t)
    variance = sds[0] ** 2 + sds[1] ** 2
    return PairedTest(
        p_value=float(2.0 * stats.t.sf(abs(t), n - 1)),
        mean_difference=difference,
        sd_of_differences=sd,
        correlation=(variance - sd**2) / (2.0 * sds[0] * sds[1]),
        effect_size=abs(t) / math.sqrt(n),
        unpaired_t=difference / math.sqrt(variance / n),
    )
