"""Finding: clock offsets of joined files against the recordings."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..joined_clocks import find_clocks
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """Report each estimated clock."""
    for clock in find_clocks(case.study):
        yield Verdict("note", clock.said, clock.do)
