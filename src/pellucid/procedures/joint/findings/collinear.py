"""Columns of the regressor that are nearly proportional."""

from __future__ import annotations

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..joint_case import JointCase

NEARLY = 100.0  # condition number, with columns of equal length


def find(case: JointCase) -> Iterator[Verdict]:
    """A condition number above which parameters trade off."""
    condition = case.fit.estimate.scaled_condition_number
    if condition > NEARLY:
        yield Verdict(
            "warning",
            f"The regressor's columns are nearly collinear (condition number {condition:.0f} with columns of equal "
            "length): some parameters trade off against each other.",
            "A richer motion helps.",
        )
