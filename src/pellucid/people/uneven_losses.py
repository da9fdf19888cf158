"""What if a condition lost more movements than the other, and lost the most extreme ones?

Movements that are lost in both conditions alike bias both means alike. The share that one condition loses beyond the
other can bias the change, and the values of lost movements are not known. Each person's movements of that condition
are therefore completed with values beyond the most extreme one that was seen, once upwards and once downwards.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import numpy as np

TAIL_RATIO = 1.5
"""Mean of the lost tail over its beginning, both as distances from the median: 1.4 if a tenth of a normal distribution
is lost, 1.5 of a lognormal one with a standard deviation of 40 %, and less of shorter tails."""


def excess_losses(lost: Mapping[str, tuple[int, int]], pair: tuple[str, str]) -> tuple[str, float] | None:
    """Return which condition of a `pair` lost the larger share of its movements, and by how much; None if neither.

    `lost` holds, by condition, the movements without a value and all movements.
    """
    one, other = ((lost[c][0] / lost[c][1] if c in lost and lost[c][1] else 0.0) for c in pair)
    if one == other:
        return None
    return (pair[0], one - other) if one > other else (pair[1], other - one)


def completed_values(
    values: np.ndarray, movements: Sequence[tuple[str, str, Hashable]], condition: str, share: float, *, upwards: bool
) -> np.ndarray:
    """Return values whose means are those with a `share` of lost movements counted beyond the most extreme one seen.

    Parameters
    ----------
    values : ndarray, shape (m,)
        Value of each movement; NaN without one.
    movements : sequence of tuple
        Person, condition and cell of alike movements, of each value.
    condition : str
        Condition that lost the movements.
    share : float
        Share of its movements, in [0, 1].
    upwards : bool
        Whether lost movements count as larger than the largest one seen; otherwise as smaller than the smallest one.

    Returns
    -------
    ndarray, shape (m,)
    """
    seen = np.isfinite(values)
    groups: dict[str, dict[Hashable, list[int]]] = {}
    for i, (person, own, cell) in enumerate(movements):
        if seen[i] and own == condition:
            groups.setdefault(person, {}).setdefault(cell, []).append(i)
    is_positive = bool((values[seen] > 0.0).all())
    scaled = np.log(np.where(values > 0.0, values, np.nan)) if is_positive else values
    made, sign = np.array(values, float), 1.0 if upwards else -1.0
    for cells in groups.values():
        middles = {cell: float(np.median(scaled[rows])) for cell, rows in cells.items()}
        furthest = max(float(np.max(sign * (scaled[rows] - middles[cell]))) for cell, rows in cells.items())
        for cell, rows in cells.items():
            tail = middles[cell] + sign * TAIL_RATIO * furthest
            made[rows] = (1.0 - share) * values[rows] + share * (float(np.exp(tail)) if is_positive else tail)
    return made
