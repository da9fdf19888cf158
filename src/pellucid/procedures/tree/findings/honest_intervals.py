"""Whether standard errors agree with leaving segments out."""

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..tree_result import TreeResult

ENOUGH = 80.0
"""Per cent of parameters within a factor of two."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """How many agree."""
    if case.jackknife is None:
        return
    share = case.jackknife.share_within
    text = f"{share:.3g} % of the standard errors are within a factor of two of what leaving out each segment shows"
    text += f"; the textbook's are {case.jackknife.textbook_ratio:.2g} times too small."
    do = "" if share >= ENOUGH else "Record longer: there are too few segments to tell how sure the numbers are."
    yield Verdict("good" if share >= ENOUGH else "warning", text, do)
