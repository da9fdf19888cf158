"""Whether the prediction interval, made on fitted residuals, holds on what was held out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....fit.parameter import Verdict
from ..joint_case import JointCase

SLACK = 0.05  # share of held-out samples a prediction interval may miss beyond its level


def find(case: JointCase) -> Iterator[Verdict]:
    """A prediction interval that holds too few held-out samples."""
    held = [p for p in case.fit.predictions if p.split == "heldout"]
    if not held:
        return
    share = np.average([p.coverage for p in held], weights=[len(p.time) for p in held])
    if share < case.level - SLACK:
        yield Verdict(
            "warning",
            f"The {100 * case.level:.3g} % prediction interval holds only {100 * share:.0f} % of held-out samples: "
            "those recordings ask for something that the fitted ones do not show.",
        )
