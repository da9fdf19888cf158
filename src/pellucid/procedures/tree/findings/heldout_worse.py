"""Joints that are predicted much worse where nothing was fitted."""

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..tree_result import JUDGED, TreeResult

TIMES = 1.5

MAX_GOOD_ERROR = 20.0
"""Error [% of the RMS effort] up to which a joint's prediction is called good."""


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
    large = {
        joint: error
        for joint, error in zip(case.names, judged.each, strict=True)
        if error > MAX_GOOD_ERROR and joint not in worse
    }
    for joint, error in large.items():
        yield Verdict(
            "warning",
            f"At {joint} the model misses {error:.2g} % on {JUDGED[case.judged]}, more than the {MAX_GOOD_ERROR:g} % "
            "of a good prediction.",
            "Look for what the model lacks there: load friction, ripple, a cable, or an effort that is hardly used.",
            weight=error / 100.0,
        )
    if not worse and not large:
        text = (
            f"On {JUDGED[case.judged]} no joint is predicted more than {TIMES:g} times worse than on what was fitted, "
            f"and each to {MAX_GOOD_ERROR:g} % or better."
        )
        yield Verdict("good", text)
