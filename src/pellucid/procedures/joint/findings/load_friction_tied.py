"""Load friction without a known load."""

from __future__ import annotations

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """That one coefficient stands for two."""
    if "load_friction" in case.fit.model.names:
        yield Verdict(
            "note",
            "Without a known load, motoring and generating load friction cannot be told apart from the load itself: "
            "one coefficient stands for both, and the intervals of inertia and gravity leave room for either.",
        )
