"""Linear programs with a few unknowns and many limits, without SciPy's solver, which takes long to load."""

from __future__ import annotations

import numpy as np

PIVOT_TOLERANCE = 1e-12
"""A reduced gain, or an entry of a row, below this share of the largest one counts as 0."""


def largest_within(gain: np.ndarray, rows: np.ndarray, limits: np.ndarray, highest: np.ndarray) -> np.ndarray:
    """Return x, (p,), from 0 to `highest` with the largest ``gain @ x`` such that ``rows @ x <= limits``.

    `gain`, `highest` (p,), `rows` (k, p), `limits` (k,); limits and `highest` are at least 0, so that x = 0 is a start.
    Dantzig's simplex method, with Bland's rule where a step does not improve, so that it ends.
    """
    free = np.flatnonzero(highest > 0.0)
    scale, count = highest[free], len(free)
    # Unknowns are shares of their highest values; the identity bounds them by 1.
    table = rows[:, free] * scale
    # Other rows bind nowhere within the bounds, and their quotients may overflow.
    binds = np.maximum(table, 0.0).sum(axis=1) > limits
    table = np.vstack([table[binds], np.eye(count)])
    sizes = np.maximum(np.abs(table).max(axis=1, initial=0.0), np.finfo(float).tiny)
    table, room = table / sizes[:, None], np.concatenate([limits[binds], np.ones(count)]) / sizes
    reduced = gain[free] * scale
    least = PIVOT_TOLERANCE * np.abs(reduced).max(initial=0.0)
    outside, inside = np.arange(count), count + np.arange(len(table))
    stalled = False
    while (rising := np.flatnonzero(reduced > least)).size:
        column = rising[np.argmin(outside[rising])] if stalled else rising[np.argmax(reduced[rising])]
        entries = table[:, column]
        binding = np.flatnonzero(entries > PIVOT_TOLERANCE)
        steps = room[binding] / entries[binding]
        step = float(steps.min())
        ties = binding[steps <= step]
        row = ties[np.argmin(inside[ties])]
        stalled = step <= 0.0
        pivot = entries[row]
        leaving, others = table[row] / pivot, np.arange(len(table)) != row
        factors = entries.copy()
        room[others] = np.maximum(room[others] - factors[others] * (room[row] / pivot), 0.0)
        room[row] /= pivot
        table[others] -= factors[others, None] * leaving
        table[others, column] = -factors[others] / pivot
        table[row] = leaving
        table[row, column] = 1.0 / pivot
        own = reduced[column]
        reduced = reduced - own * leaving
        reduced[column] = -own / pivot
        outside[column], inside[row] = inside[row], outside[column]
    shares = np.zeros(count + len(table))
    shares[inside] = room
    found = np.zeros(len(highest))
    found[free] = scale * shares[:count]
    return found
