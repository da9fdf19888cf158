"""Finding: friction grows with the load, which a model without load friction mistakes for gravity."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..tree_result import TreeResult


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the joints with load friction."""
    shares = {
        joint: p.value for joint in case.names if (p := case.best.parameters.get(f"{joint}.load")) and not p.refused
    }
    if shares:
        shares_text = ", ".join(f"{100.0 * share:.2g} % of the load at {joint}" for joint, share in shares.items())
        yield Verdict("note", f"Friction grows with the load: {shares_text}.", weight=max(shares.values()))
