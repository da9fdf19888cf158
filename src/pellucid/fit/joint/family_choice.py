"""Choose the simplest friction family that does not predict held-out effort significantly worse than the best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..block_test import HeldOutComparison, compare_held_out
from .friction_family import FamilyFit


def compare_families(fits: Mapping[str, FamilyFit]) -> HeldOutComparison:
    """Compare the least-squares residuals of all families on the same held-out samples.

    Without held-out recordings the residuals are those of cross-validation over blocks.
    """
    held = {n: [p.residual for p in f.predictions if p.split == "heldout"] for n, f in fits.items()}
    return compare_held_out(held if all(held.values()) else {n: f.crossed for n, f in fits.items()})


def order_by_simplicity(fits: Mapping[str, FamilyFit], found: HeldOutComparison) -> Sequence[str]:
    """Return the families in the order of their number of free parameters, then of their error."""
    return sorted(fits, key=lambda n: (len(fits[n].model.symbols), found.errors[n]))


def choose_family(fits: Mapping[str, FamilyFit], found: HeldOutComparison) -> str:
    """Return the simplest family that is not significantly worse than the one with the smallest error."""
    return found.first(order_by_simplicity(fits, found))
