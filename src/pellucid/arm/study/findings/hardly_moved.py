"""Finding: a joint moves so little that its parameters depend on few rows."""

from collections.abc import Iterator

import numpy as np

from ....models.parameter import Verdict
from ..tree_result import TreeResult

MIN_MOVING_SHARE = 0.2
"""Smallest share of the rows in which a joint should move."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the joints that hardly move."""
    moving = np.concatenate([t.moving for t in case.traces if t.use == "fit"]).mean(axis=0)
    for joint, share in zip(case.names, moving, strict=True):
        if share < MIN_MOVING_SHARE:
            yield Verdict(
                "warning",
                f"Joint {joint} moves in {100.0 * share:.2g} % of the fitted rows: its friction rests on these.",
                "Record motion in which it goes both ways, slowly and fast.",
                weight=MIN_MOVING_SHARE - share,
            )
