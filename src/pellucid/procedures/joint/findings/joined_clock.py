"""How the clocks of joined files lie against the recordings'."""

from __future__ import annotations

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..joined_clocks import clocks
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """Each clock that was found."""
    for clock in clocks(case.study):
        yield Verdict("note", clock.said, clock.do)
