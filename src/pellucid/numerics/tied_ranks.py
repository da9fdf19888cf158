"""Ranks in which values that differ by rounding alone are tied.

A difference of two readings with a resolution of 0.01 is not a multiple of 0.01 in floating point: 0.07 - 0.06 and
0.03 - 0.02 differ by 2e-17. Ranks of such differences would be decided by rounding. Every rank in the package comes
from here.
"""

from __future__ import annotations

import numpy as np

TIE_TOLERANCE = 1e-11
"""Two values are tied if they differ by less than this share of their scale, the largest of the numbers that they were
computed from. The rounding of a mean of a thousand numbers reaches 1e-13 of it; no instrument resolves 1e-11."""


def scale_of(*values: np.ndarray) -> float:
    """Return the largest absolute finite value of arrays; 0 without one."""
    finite = [np.abs(each[np.isfinite(each)]) for each in map(np.asarray, values)]
    return float(max((np.max(each, initial=0.0) for each in finite), default=0.0))


def tie_groups(values: np.ndarray, scale: float | None = None, axis: int = -1) -> np.ndarray:
    """Return integers in the order of `values` along an axis, equal for tied values; same shape.

    `scale` is the size of the numbers that the values were computed from; by default the largest value of each row.
    """
    values = np.moveaxis(np.asarray(values, float), axis, -1)
    sizes = np.where(np.isfinite(values), np.abs(values), 0.0)
    own = np.max(sizes, axis=-1, keepdims=True, initial=0.0) if scale is None else scale
    order = np.argsort(values, axis=-1)
    with np.errstate(invalid="ignore"):  # infinite values are tied with each other
        apart = np.diff(np.take_along_axis(values, order, axis=-1), axis=-1) > TIE_TOLERANCE * own
    groups = np.zeros(values.shape, int)
    groups[..., 1:] = np.cumsum(apart, axis=-1)
    placed = np.empty_like(groups)
    np.put_along_axis(placed, order, groups, axis=-1)
    return np.moveaxis(placed, -1, axis)


def tied_ranks(values: np.ndarray, scale: float | None = None, axis: int = -1) -> np.ndarray:
    """Return the ranks of `values` along an axis, from 1; ties share their mean rank. `scale` as in `tie_groups`."""
    groups = tie_groups(values, scale, axis)
    # Without a tie the groups of each row are 0 to n - 1.
    untied = groups.size and np.all(groups.max(axis=axis) == groups.shape[axis] - 1)
    return groups + 1.0 if untied else np.moveaxis(_mean_ranks(np.moveaxis(groups, axis, -1)), -1, axis)


def _mean_ranks(groups: np.ndarray) -> np.ndarray:
    """Return the mean rank of the group of each value, from the groups of `tie_groups` along the last axis."""
    rows = groups.reshape(-1, groups.shape[-1])
    width = rows.shape[1]
    counts = np.bincount((rows + width * np.arange(len(rows))[:, None]).ravel(), minlength=rows.size)
    counts = counts.reshape(rows.shape)
    ranks = np.cumsum(counts, axis=1) - 0.5 * (counts - 1)
    return np.take_along_axis(ranks, rows, axis=1).reshape(groups.shape)


def tied_signs(differences: np.ndarray, scale: float | None = None) -> np.ndarray:
    """Return -1, 0 or 1 for each of `differences`: 0 where rounding alone makes it. `scale` as in `tie_groups`."""
    differences = np.asarray(differences, float)
    limit = TIE_TOLERANCE * (scale_of(differences) if scale is None else scale)
    return np.where(np.abs(differences) <= limit, 0.0, np.sign(differences))
