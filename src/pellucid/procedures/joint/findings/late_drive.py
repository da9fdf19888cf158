"""How late the drive was recorded against the encoder, and that it was moved."""

from __future__ import annotations

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..aligned_motions import alignment
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """A delay that was found, or that was asked for in vain."""
    found = alignment(case.study)
    if found is not None and found.said:
        yield Verdict("warning" if found.moved else "note", found.said, found.do)
