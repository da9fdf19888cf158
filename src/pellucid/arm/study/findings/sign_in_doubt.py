"""Finding: a joint fits slightly better when flipped."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..tree_result import TreeResult


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the evidence against a sign; predictions for other motions may then be far off."""
    for doubt in case.doubts:
        yield Verdict("warning", f"A sign may be wrong: {doubt}.")
