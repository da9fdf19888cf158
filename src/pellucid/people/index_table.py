"""Each participant's value of an index in each condition.

A value is a mean over movements that are alike (one amplitude, one direction), then over these cells, of those alone
that the participant has in every condition: a movement left out does not tip the balance between short and long ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..units import COORDINATES_BY_UNIT
from .indices import Index, indices_along
from .measured import MeasuredMovement, MovementDuration
from .survival import survival


@dataclass(frozen=True, eq=False)
class IndexTable:
    """Values of one index by participant and condition.

    A table holds the name of its index, not the index, so that a kept result restores data and no functions.
    """

    name: str  # name of the index in the catalogue
    along: str  # unit of the coordinate of movement, "rad" or "m"
    participants: tuple[str, ...]  # participants with a value in all of `conditions`
    conditions: tuple[str, ...]
    values: np.ndarray  # (n, k)

    @property
    def index(self) -> Index:
        """Entry of the catalogue for this coordinate."""
        return indices_along(COORDINATES_BY_UNIT[self.along])[self.name]

    def column(self, condition: str) -> np.ndarray:
        """Return the values in one condition, shape (n,)."""
        return self.values[:, self.conditions.index(condition)]


def cell_means(
    movements: Sequence[MeasuredMovement], of: str, direction: str = "", *, spread: bool = False
) -> dict[tuple, float]:
    """Return the mean value `of` similar movements by (participant, condition, cell), in one `direction` or both ("").

    With `spread` the result holds their standard deviations (n - 1), without cells of a single movement.
    """
    sums: dict[tuple, list[float]] = {}
    for m in movements:
        value = m.values.get(of, np.nan)
        if np.isfinite(value) and direction in ("", m.cell[1]):
            sums.setdefault((m.participant, m.condition, m.cell), []).append(value)
    if spread:
        return {key: float(np.std(each, ddof=1)) for key, each in sums.items() if len(each) > 1}
    return {key: float(np.mean(each)) for key, each in sums.items()}


def shared_cells(
    means: Mapping[tuple, float], participants: Sequence[str], conditions: Sequence[str]
) -> dict[str, dict[str, np.ndarray]]:
    """Return each participant's values of the cells that they have in every condition, by participant and condition.

    `means` are the values by (participant, condition, cell); who has no cell in all `conditions` is not in the result.
    """
    cells: dict[tuple[str, str], set] = {}
    for person, condition, cell in means:
        cells.setdefault((person, condition), set()).add(cell)
    found = {}
    for person in participants:
        shared = set.intersection(*(cells.get((person, c), set()) for c in conditions))
        if shared:
            ordered = sorted(shared, key=str)
            found[person] = {c: np.array([means[person, c, cell] for cell in ordered]) for c in conditions}
    return found


def lasting_cells(lasted: Sequence[MovementDuration], index: Index) -> dict[tuple, float]:
    """Return the value of a lasting `index` from how long similar movements lasted, by (participant, condition, cell).

    A median that was not reached is replaced by the longest time seen. The result is empty if the index needs movements
    that never settled and there are none.
    """
    cells: dict[tuple, list[MovementDuration]] = {}
    for each in lasted:
        cells.setdefault((each.participant, each.condition, each.cell), []).append(each)
    if index.of_curve is None or (index.needs_unsettled and all(each.settled for each in lasted)):
        return {}
    found = {}
    for key, own in cells.items():
        curve = survival(np.array([each.seconds for each in own]), np.array([each.settled for each in own]))
        found[key] = index.of_curve(curve)
    return found


def index_table(
    movements: Sequence[MeasuredMovement],
    index: Index,
    participants: Sequence[str],
    conditions: Sequence[str],
    control: str,
    lasted: Sequence[MovementDuration] = (),
) -> IndexTable | None:
    """Return the values of `index` of the `participants` who have it under all `conditions`; None if nobody has.

    An index over `control` has no column for control, nor has one that needs a robot. `movements` holds all movements,
    and `lasted` how long each was seen.
    """
    if index.lasting:
        means = lasting_cells(lasted, index)
    else:
        means = cell_means(movements, index.of, index.direction, spread=index.spread)
    recorded = [c for c in conditions if any(key[1] == c for key in means)]
    # Without a robot there is no interaction: a condition in which nobody has a value is no column.
    if not recorded or (index.over_control and (control not in recorded or len(recorded) < 2)):
        return None
    rows, people = [], []
    for person, value in shared_cells(means, participants, recorded).items():
        if index.over_control:
            rows.append([float(np.mean(value[c] / value[control] - 1.0)) for c in recorded if c != control])
        else:
            rows.append([float(np.mean(value[c])) for c in recorded])
        people.append(person)
    if not rows:
        return None
    shown = tuple(c for c in recorded if not (index.over_control and c == control))
    return IndexTable(index.name, index.along, tuple(people), shown, np.array(rows))
