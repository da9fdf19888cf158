"""Joints that moved so little that their numbers rest on few rows."""

from collections.abc import Iterator

import numpy as np

from ....fit.parameter import Verdict
from ..tree_result import TreeResult

SHARE = 0.2
"""Of the rows, in which a joint that is excited moves at least."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """Which joints hardly move."""
    moving = np.concatenate([t.moving for t in case.traces if t.use == "fit"]).mean(axis=0)
    for joint, share in zip(case.names, moving, strict=True):
        if share < SHARE:
            yield Verdict(
                "warning",
                f"Joint {joint} moves in {100.0 * share:.2g} % of the fitted rows: its friction rests on these.",
                "Record motion in which it goes both ways, slowly and fast.",
                weight=SHARE - share,
            )
