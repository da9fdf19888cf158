"""How late the drive was recorded against the encoder, and that it was moved."""

from __future__ import annotations

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..aligned_motions import alignments
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """A delay that was found, or that was asked for in vain."""
    for found in alignments(case.study):
        if found.said:
            told = found.moved or found.recording
            yield Verdict("warning" if told else "note", found.said, found.do)
