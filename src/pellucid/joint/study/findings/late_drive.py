"""Finding: the drive is delayed against the encoder."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..aligned_motions import find_alignments
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """Report a delay that was found, or a requested one that was not."""
    for found in find_alignments(case.study):
        if found.said:
            is_warning = found.moved or found.recording
            yield Verdict("warning" if is_warning else "note", found.said, found.do)
