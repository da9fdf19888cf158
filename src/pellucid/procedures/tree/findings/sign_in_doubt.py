"""A joint that fits a little better turned around."""

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..tree_result import TreeResult


def find(case: TreeResult) -> Iterator[Verdict]:
    """What speaks against a sign: efforts like these hardly tell, and those of other motions may be far off."""
    for doubt in case.doubts:
        yield Verdict("warning", f"A sign may be wrong: {doubt}.")
