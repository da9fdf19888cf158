"""Participants' changes of how long movements last, as bounds where the end of some was not seen.

A median that was not reached lasted longer than anything seen: the change from control then has no upper bound, and
where it is control's that was not reached no lower one. The mean of durations has neither as soon as one of them was
cut off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .measured import MovementDuration
from .survival import survival


def lasting_bounds(
    lasted: Sequence[MovementDuration],
    participants: Sequence[str],
    conditions: Sequence[str],
    control: str,
    compared: str,
    change: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return lower and upper bounds of the change of median durations, (n,) each; None without shared cells.

    `change` maps the medians [s] in `compared` and in `control` to the change. Only cells of movements that occur in
    all `conditions` count.
    """
    cells: dict[tuple, list[MovementDuration]] = {}
    for each in lasted:
        cells.setdefault((each.participant, each.condition, each.cell), []).append(each)
    longest = max((each.seconds for each in lasted if np.isfinite(each.seconds)), default=0.0)
    values, reached = [], []
    for person in participants:
        shared = set.intersection(*({key[2] for key in cells if key[:2] == (person, c)} for c in conditions))
        if not shared:
            return None
        found = [
            [_bounded_median(cells[person, condition, cell], longest) for cell in sorted(shared, key=str)]
            for condition in (control, compared)
        ]
        values.append([np.mean([value for value, _ in own]) for own in found])
        reached.append([all(known for _, known in own) for own in found])
    (base, own), (base_known, own_known) = np.array(values).T, np.array(reached).T
    seen = change(own, base)
    return np.where(base_known, seen, -np.inf), np.where(own_known, seen, np.inf)


def _bounded_median(own: Sequence[MovementDuration], longest: float) -> tuple[float, bool]:
    """Return the median duration of similar movements [s], and whether it was reached.

    A movement that never settled counts as longer than the longest one.
    """
    seconds = np.minimum([each.seconds for each in own], longest)
    curve = survival(seconds, np.array([each.settled for each in own]))
    return curve.bounded_median, bool(np.isfinite(curve.median))
