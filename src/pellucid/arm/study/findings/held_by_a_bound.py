"""Finding: friction or inertia is held at a physical bound."""

from collections.abc import Iterator

from ....models.parameter import Verdict
from ..tree_result import TreeResult


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the parameters on a physical bound."""
    named = (p.name.rpartition(".") for p in case.best.parameters.values() if p.at_bound)
    held = [f"{number} of {of}".replace("_", " ") for of, _, number in named]
    if held:
        text = f"A physical bound holds {', '.join(held)}: there is none to see, or another term has taken its share."
        yield Verdict("note", text, weight=len(held))
