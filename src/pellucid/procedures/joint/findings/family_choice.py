"""Why this friction family: what the others do on the same held-out samples, and whether that is chance."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....fit.block_test import LEVEL
from ....fit.parameter import Verdict
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """The families that do significantly worse, and those that do no better."""
    if len(case.fits) == 1 or case.contest is None:
        return
    found, best = case.contest, case.best
    where = (
        "on held-out effort" if np.isfinite(case.fit.heldout_effort_error) else "on blocks predicted from the others"
    )
    simpler = [n for n in case.fits if len(case.fits[n].model.symbols) < len(case.fits[best].model.symbols)]
    if simpler:
        nearest = min(simpler, key=found.errors.__getitem__)
        gain = 100.0 * (1.0 - found.errors[best] / found.errors[nearest])
        yield Verdict(
            "good",
            f"The '{best}' family is {gain:.2g} % better {where} than '{nearest}', and every simpler family is "
            f"significantly worse than the best (p < {LEVEL:g}, paired test over {found.blocks} or more blocks).",
        )
    elif found.winner != best:
        gain = 100.0 * (1.0 - found.errors[found.winner] / found.errors[best])
        yield Verdict(
            "note",
            f"The '{found.winner}' family is {gain:.2g} % better {where}, which may be chance "
            f"(p = {found.p_values[best]:.2g}): the simplest family that is not significantly worse is used.",
        )
    else:
        yield Verdict("note", f"No richer friction family predicts better {where} than '{best}'.")
