"""Joints that are predicted much worse where nothing was fitted."""

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..tree_result import JUDGED, TreeResult

TIMES = 1.5


def find(case: TreeResult) -> Iterator[Verdict]:
    """How the errors compare."""
    fitted, judged = case.errors_of("best", "fitted"), case.errors_of("best", case.judged)
    if case.judged == "fitted":
        yield Verdict("warning", "Nothing was left out to judge by.", "Record more, or mark a recording to validate.")
        return
    worse = {joint: (a, b) for joint, a, b in zip(case.names, fitted.each, judged.each, strict=True) if b > TIMES * a}
    for joint, (a, b) in worse.items():
        yield Verdict(
            "warning",
            f"At {joint} the model misses {b:.2g} % on {JUDGED[case.judged]} and {a:.2g} % on what was fitted: it has "
            "learnt what does not last, or the machine has changed.",
            "Record more motion of that kind, or compare recordings of one day.",
            weight=b / a,
        )
    if not worse:
        text = (
            f"On {JUDGED[case.judged]} no joint is predicted more than {TIMES:g} times worse than on what was fitted."
        )
        yield Verdict("good", text)
