"""Finding: the residuals are autocorrelated."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """Report how many of a hundred residuals are effectively independent."""
    white = case.fit.estimate.whiteness
    if white is not None and white.effective_share < 0.5:
        yield Verdict(
            "note",
            "Residuals are coloured: 100 samples carry about as much as "
            f"{max(100 * white.effective_share, 1):.0f} independent ones. Intervals allow for it; textbook intervals "
            "would be too narrow.",
        )
