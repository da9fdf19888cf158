"""Movements in an angle record and their indices: duration, peak velocity, smoothness, straight from arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .._errors import RecordingError
from .movements import (
    MovementRule,
    kinematics,
    movements,
    rest_stretches,
    target_stretches,
)
from .smoothness import smoothness

UNITS = {
    "start": "s", "duration": "s", "direction": "1", "travel": "rad", "peak_velocity": "rad/s",
    "mean_velocity": "rad/s", "peak_acceleration": "rad/s^2", "peak_time": "1", "sparc": "1", "ldlj": "1",
}  # fmt: skip
"""Unit of every index that needs the angle alone."""


@dataclass(frozen=True, eq=False)
class MovementIndices(Mapping[str, np.ndarray]):
    """Indices of every movement of a record by name; each is an array with one value for each movement.

    Attributes
    ----------
    columns : Mapping of str to ndarray, shape (movements,)
        start, duration [s], direction (1 along the angle, -1 against it), travel [rad], peak_velocity (largest speed),
        mean_velocity [rad/s], peak_acceleration [rad/s^2], peak_time (of the largest speed, as a share of the
        duration), sparc, ldlj.
    left_out : Mapping of str to int
        Number of stretches of the record without a movement, by reason.
    """

    columns: Mapping[str, np.ndarray]
    left_out: Mapping[str, int]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def count(self) -> int:
        """Number of movements."""
        return len(self.columns["start"])

    def _table(self) -> list[list[str]]:
        head = [f"{name} ({UNITS[name]})" if UNITS[name] != "1" else name for name in self]
        return [head, *([f"{x:.3g}" for x in row] for row in zip(*self.values(), strict=True))]

    def __str__(self) -> str:
        table = self._table()
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in table]
        left = ", ".join(f"{n} {reason}" for reason, n in self.left_out.items())
        return "\n".join((f"{self.count} movements" + (f"; left out: {left}" if left else ""), *lines))

    def _repr_html_(self) -> str:
        cells = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in self._table()]
        body = "".join(f"<tr>{row}</tr>" for row in (cells[0].replace("td>", "th>"), *cells[1:]))
        return f"<table><caption>{self.count} movements</caption>{body}</table>"


def movement_indices(
    time: ArrayLike,
    angle: ArrayLike,
    *,
    target: ArrayLike | None = None,
    lowpass: float = 3.0,
    order: int = 4,
    threshold: float = 0.05,
    ends: Literal["all", "peak"] = "all",
    least: float = 0.05,
) -> MovementIndices:
    """Find the point-to-point movements of a record, and compute each one's indices.

    Parameters
    ----------
    time, angle : array_like, shape (n,)
        [s], increasing, and [rad]; NaN where a sample is missing.
    target : array_like, shape (n,), optional
        Angle that is pointed to, constant between its steps [rad]: a movement for each step. Left out, a movement for
        each stretch between two rests.
    lowpass, order : float, int
        Cut-off [Hz] and order of one pass of the zero-phase Butterworth filter on the angle.
    threshold : float
        Share of a movement's largest speed that begins and ends it.
    ends : str
        ``"all"``: from the first to the last sample above it; ``"peak"``: only the run of samples with the largest.
    least : float
        Travel that makes a movement where there is no target [rad].

    Returns
    -------
    MovementIndices
        By name, one value a movement.

    Raises
    ------
    RecordingError
        If shapes differ, time does not increase, the filter does not fit the rate, or there is no movement.

    Examples
    --------
    A minute of minimum-jerk movements of 40 degrees in 0.8 s, whose SPARC is -1.40 and LDLJ -5.32:

    >>> import numpy as np
    >>> import pellucid as pl
    >>> time = np.arange(0.0, 60.0, 0.005)
    >>> share = np.clip((time % 3.0 - 1.0) / 0.8, 0.0, 1.0)
    >>> rise = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    >>> angle = np.radians(40.0) * np.where(time // 3.0 % 2 == 0, rise, 1.0 - rise)
    >>> found = pl.movement_indices(time, angle, lowpass=10.0)
    >>> found.count, float(found["duration"].mean().round(2)), float(found["peak_velocity"].mean().round(2))
    (20, 0.7, 1.64)
    >>> float(found["sparc"].mean().round(1))
    -1.4
    """
    time, angle = np.asarray(time, float), np.asarray(angle, float)
    rule = MovementRule(lowpass, order, threshold, ends)
    if time.ndim != 1 or angle.shape != time.shape or (target is not None and np.shape(target) != time.shape):
        shapes = [np.shape(x) for x in (time, angle, *(() if target is None else (target,)))]
        raise RecordingError(f"movements: found time, angle and target of the shapes {shapes}, expected (n,) of each")
    motion = kinematics(time, angle, rule)
    if target is None:
        stretches = rest_stretches(motion, rule, least=least)
    else:
        stretches = target_stretches(time, np.asarray(target, float))
    found, without = movements(motion, stretches, rule)
    if not found:
        reasons = ", ".join(sorted({f"{each.kind} ({each.found})" for each in without}))
        raise RecordingError(f"movements: found none in {len(stretches)} stretches, expected some {reasons}".rstrip())
    rows = [
        {name: getattr(each, name) for name in UNITS if hasattr(each, name)} | smoothness(motion, each)
        for each in found
    ]
    return MovementIndices(
        {name: np.array([row[name] for row in rows], float) for name in UNITS},
        dict(Counter(each.kind for each in without)),
    )
