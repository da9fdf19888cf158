"""Finding: agreement of the standard errors with the jackknife over segments."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..tree_result import TreeResult

MIN_AGREEING_PERCENT = 80.0
"""Smallest share of standard errors that should agree with the jackknife's within a factor of two [%]."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the share of standard errors that agree."""
    if case.jackknife is None:
        return
    share = case.jackknife.share_within
    text = f"{share:.3g} % of the standard errors are within a factor of two of what leaving out each segment shows"
    text += f"; the textbook's are {case.jackknife.textbook_ratio:.2g} times too small."
    do = (
        ""
        if share >= MIN_AGREEING_PERCENT
        else "Record longer: there are too few segments to tell how sure the numbers are."
    )
    yield Verdict("good" if share >= MIN_AGREEING_PERCENT else "warning", text, do)
