"""What the richer friction families add to symmetric friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....fit.parameter import Verdict
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """The gain of the best family over symmetric friction on held-out effort."""
    fits, best = case.fits, case.best
    plain = fits.get("symmetric")
    if plain is None or len(fits) == 1 or not np.isfinite(case.fit.heldout_effort_error):
        return
    if best == "symmetric":
        yield Verdict("note", "No richer friction family predicts held-out effort better by 3 % or more.")
        return
    gain = 100.0 * (1.0 - fits[best].heldout_effort_error / plain.heldout_effort_error)
    yield Verdict(
        "good" if gain > 2.0 else "note",
        f"It is {gain:.2g} % better on held-out effort than symmetric friction "
        f"({plain.heldout_effort_error:.3g} %)" + ("." if gain > 2.0 else ": too little to matter."),
    )
