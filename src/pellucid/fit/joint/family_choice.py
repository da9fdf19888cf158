"""Which friction family is the best: the simplest that does not predict held-out effort significantly worse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..block_test import Contest, contest
from .friction_family import FamilyFit


def family_contest(fits: Mapping[str, FamilyFit]) -> Contest:
    """All families by least squares on the same held-out samples, or on blocks each predicted from the others where
    nothing is held out."""
    held = {n: [p.residual for p in f.predictions if p.split == "heldout"] for n, f in fits.items()}
    return contest(held if all(held.values()) else {n: f.crossed for n, f in fits.items()})


def simplest_first(fits: Mapping[str, FamilyFit], found: Contest) -> Sequence[str]:
    """Families by their number of free parameters; of those with as many, the one that errs less."""
    return sorted(fits, key=lambda n: (len(fits[n].model.symbols), found.errors[n]))


def best_family(fits: Mapping[str, FamilyFit], found: Contest) -> str:
    """The simplest family that is not significantly worse than the one with the smallest error."""
    return found.first(simplest_first(fits, found))
