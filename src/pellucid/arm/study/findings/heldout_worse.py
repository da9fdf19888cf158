"""Finding: a joint is predicted much worse on data that were not fitted."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ....study.procedures.badge_bounds import MAX_GOOD_ERROR
from ..tree_result import ROW_KIND_DESCRIPTIONS, TreeResult

MAX_ERROR_RATIO = 1.5
"""A joint is predicted much worse if its error exceeds this multiple of the fitted error. Chosen by judgement; no
measurement is recorded."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report joints with much larger, or with large, errors on data that were not fitted."""
    fitted, judged = case.errors_of("best", "fitted"), case.errors_of("best", case.judged)
    if case.judged == "fitted":
        yield Verdict("warning", "Nothing was left out to judge by.", "Record more, or mark a recording to validate.")
        return
    worse = {
        joint: (a, b)
        for joint, a, b in zip(case.names, fitted.each, judged.each, strict=True)
        if b > MAX_ERROR_RATIO * a
    }
    for joint, (a, b) in worse.items():
        yield Verdict(
            "warning",
            f"At {joint} the model misses {b:.2g} % on {ROW_KIND_DESCRIPTIONS[case.judged]} and {a:.2g} % on what was "
            "fitted: it has learnt what does not last, or the machine has changed.",
            "Record more motion of that kind, or compare recordings of one day.",
            weight=b / a,
        )
    large = {
        joint: error
        for joint, error in zip(case.names, judged.each, strict=True)
        if error > MAX_GOOD_ERROR and joint not in worse
    }
    for joint, error in large.items():
        yield Verdict(
            "warning",
            f"At {joint} the model misses {error:.2g} % on {ROW_KIND_DESCRIPTIONS[case.judged]}, more than the "
            f"{MAX_GOOD_ERROR:g} % of a good prediction.",
            "Look for what the model lacks there: load friction, ripple, a cable, or an effort that is hardly used.",
            weight=error / 100.0,
        )
    if not worse and not large:
        text = (
            f"On {ROW_KIND_DESCRIPTIONS[case.judged]} no joint is predicted more than {MAX_ERROR_RATIO:g} times worse "
            f"than on what was fitted, and each to {MAX_GOOD_ERROR:g} % or better."
        )
        yield Verdict("good", text)
