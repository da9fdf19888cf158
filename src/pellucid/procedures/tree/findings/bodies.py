"""What it costs that every link is a body that can exist."""

from collections.abc import Iterator

from ....fit.parameter import Verdict
from ..tree_result import JUDGED, TreeResult

CHEAP = 0.1
"""Points of the mean error that are worth nothing [%]."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """The loss, and what least squares alone made of the bodies."""
    for model, why in case.failures.items():
        yield Verdict("warning", f"No {model} model: {why}.", "Check masses, signs and gears.")
    best, bodies = case.errors_of("best", case.judged), case.errors_of("consistent", case.judged)
    if best is None or bodies is None:
        return
    loss = bodies.mean - best.mean
    said = "; ".join(case.models["consistent"].notes)
    text = f"Bodies that can exist change the mean error on {JUDGED[case.judged]} by {loss:+.2g} points"
    text += f" ({said})." if said else "."
    if loss <= CHEAP:
        yield Verdict("good", text)
    else:
        yield Verdict(
            "warning", text, "Check masses, signs and gears: efforts ask for bodies that cannot be.", weight=loss
        )
