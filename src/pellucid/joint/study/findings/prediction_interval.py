"""Finding: coverage of the predictive band on held-out data, overall and by condition of motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....models.parameter import Verdict
from ..joint_case import JointCase

MAX_COVERAGE_SHORTFALL = 0.05
"""Coverage is too low if it is below its level by more than this share of samples."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report a band with too low cross-validated coverage, overall or under one condition."""
    held = [p for p in case.fit.predictions if p.split == "heldout"]
    if not held:
        return
    share = np.average([p.coverage for p in held], weights=[len(p.time) for p in held])
    if share < case.level - MAX_COVERAGE_SHORTFALL:
        yield Verdict(
            "warning",
            f"The {100 * case.level:.3g} % prediction interval holds only {100 * share:.0f} % of held-out samples: "
            "those recordings ask for something that the fitted ones do not show.",
        )
        return
    band = case.fit.headline.band
    for kind in ("direction", "speed", "position") if band is not None else ():
        worst = min((c for c in band.conditions if c.kind == kind), key=lambda c: c.coverage, default=None)
        if worst is not None and worst.coverage < case.level - 2.0 * MAX_COVERAGE_SHORTFALL:
            yield Verdict(
                "note",
                f"The {100 * case.level:.3g} % prediction interval holds {100 * share:.0f} % of held-out samples, but "
                f"{100 * worst.coverage:.0f} % of those with {kind} {worst.condition}: the misfit depends on it.",
            )
