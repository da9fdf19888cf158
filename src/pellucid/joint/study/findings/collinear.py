"""Finding: columns of the regressor are nearly proportional."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..joint_case import JointCase

MAX_CONDITION_NUMBER = 100.0
"""The columns are nearly proportional if the condition number of the scaled regressor exceeds this."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report a condition number at which parameters trade off."""
    condition = case.fit.estimate.scaled_condition_number
    if condition > MAX_CONDITION_NUMBER:
        yield Verdict(
            "warning",
            f"The regressor's columns are nearly collinear (condition number {condition:.0f} with columns of equal "
            "length): some parameters trade off against each other.",
            "A richer motion helps.",
        )
