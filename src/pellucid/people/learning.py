"""Were movements still changing? Each person's change from the first third of the movements to the last.

Recordings and tables ask it here: the same movements give the same answer.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from .mixed_model import Thirds, thirds


@dataclass(frozen=True, eq=False)
class OrderedMovements:
    """Values of m movements, in the unit in which changes are compared."""

    who: Sequence[str]
    what: Sequence[str]
    cells: Sequence[Hashable]  # cell of alike movements
    values: np.ndarray  # (m,); NaN if a movement has none
    order: np.ndarray | None  # (m,) place of each movement in time; NaN if it is not known; None: of none


def learning(
    movements: OrderedMovements, people: Sequence[str], conditions: Sequence[str]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return people's drift, and the last third of movements less all; (n,) each.

    `conditions` are control and the compared one, or the latter alone. Only cells that a person has in both count. None
    if somebody's order is not known, or somebody has too few movements.
    """
    if movements.order is None:
        return None
    rows: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(zip(movements.who, movements.what, strict=True)):
        if np.isfinite(movements.values[i]):
            rows.setdefault(key, []).append(i)
    drifts, late = [], []
    for person in people:
        own = [rows.get((person, c), []) for c in conditions]
        shared = set.intersection(*({movements.cells[i] for i in each} for each in own))
        parts = [_thirds(movements, [i for i in each if movements.cells[i] in shared]) for each in own]
        if None in parts:
            return None
        known = [each for each in parts if each is not None]
        drifts.append(known[-1].drift - (known[0].drift if len(known) > 1 else 0.0))
        late.append(known[-1].last - (known[0].last if len(known) > 1 else 0.0))
    return np.array(drifts), np.array(late)


def _thirds(movements: OrderedMovements, rows: Sequence[int]) -> Thirds | None:
    """Return the first and last third of movements; None without an order."""
    assert movements.order is not None
    places = movements.order[list(rows)]
    if not np.isfinite(places).all() or len(set(places.tolist())) < len(places):
        return None
    ordered = [rows[i] for i in np.argsort(places, kind="stable")]
    return thirds([float(movements.values[i]) for i in ordered], [movements.cells[i] for i in ordered])
