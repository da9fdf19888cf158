"""Share of the noise of single movements in a person's change.

Each person's change is a mean of few movements that vary, so that observed changes differ more than true ones.
Movements of one person, condition and cell are assigned in turn to a few parts, and a change is computed from each
part. The changes of one person's parts differ only by noise, and a slow drift affects all parts equally. The noise
variance of the change of all movements is that of the parts divided by their number. An effect that a whole session
shares is not noise of movements, and remains in the person's change.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

MAX_PARTS = 4
"""Largest number of parts: with five movements in each cell, as is usual, each part still has one of every cell."""

MIN_SPLIT_SHARE = 0.75
"""Smallest share of people, and of each person's cells, that must have a movement in every part."""


@dataclass(frozen=True)
class MovementNoise:
    """Variance of people's changes by the noise of their movements."""

    variance: float | np.ndarray  # mean over people, in the squared unit of their changes; of k studies (k,)
    degrees: float  # degrees of freedom of the variance


def movement_noise(
    movements: Sequence[tuple[str, str, Hashable]],
    people: Sequence[str],
    conditions: Sequence[str],
    change_of: Callable[[np.ndarray], Mapping[str, float]],
) -> MovementNoise | None:
    """Return the noise of people's changes.

    Parameters
    ----------
    movements : sequence of tuple
        Person, condition and cell of alike movements, of m movements with a value, in the order in time.
    people : sequence of str
        Who is compared.
    conditions : sequence of str
        Control and the compared condition, or the latter alone.
    change_of : callable
        Returns the change of each person by a part of the movements alone, of which it gets the rows.

    Returns
    -------
    MovementNoise or None
        None if movements are too few to be split.
    """
    rows: dict[tuple[str, Hashable], dict[str, list[int]]] = {}
    for i, (person, condition, cell) in enumerate(movements):
        if condition in conditions:
            rows.setdefault((person, cell), {}).setdefault(condition, []).append(i)
    fewest: dict[str, list[tuple[int, Hashable]]] = {person: [] for person in people}
    for (person, cell), own in rows.items():
        if person in fewest and len(own) == len(conditions):
            fewest[person].append((min(map(len, own.values())), cell))
    for count in range(MAX_PARTS, 1, -1):
        split = {
            person: [cell for least, cell in cells if least >= count] for person, cells in fewest.items()
        }
        enough = [p for p in people if split[p] and len(split[p]) >= MIN_SPLIT_SHARE * len(fewest[p])]
        if len(enough) >= max(2.0, MIN_SPLIT_SHARE * len(people)):
            break
    else:
        return None
    parts: list[list[int]] = [[] for _ in range(count)]
    for person in enough:
        for cell in split[person]:
            for own in rows[person, cell].values():
                for k in range(count):
                    parts[k] += own[k::count]
    changes = [change_of(np.array(sorted(part))) for part in parts]
    values = np.array([[each.get(person, np.nan) for person in enough] for each in changes])
    share = np.array([len(split[person]) / len(fewest[person]) for person in enough])
    known = np.isfinite(values).all(axis=0)
    if np.sum(known) < max(2.0, MIN_SPLIT_SHARE * len(people)):
        return None
    own_variance = np.var(values[:, known], axis=0, ddof=1) / count * share[known]
    size = float(np.sum(own_variance**2))
    if not size > 0.0:
        return None
    # Satterthwaite's degrees of freedom of a sum of variances of count - 1 degrees each, whose squares are unbiased.
    degrees = (count + 1.0) * float(np.sum(own_variance)) ** 2 / size
    return MovementNoise(float(own_variance.mean()), min(degrees, (count - 1.0) * len(own_variance)))
