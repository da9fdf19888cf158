"""How much numbers move when segments are left out: an independent check of what intervals say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .tree_regression import TreeModel, TreeRows, TreeSolution, fit_rows

FACTOR = 2.0
"""Within which a stated standard error and the jackknife's agree."""


@dataclass(frozen=True)
class SegmentJackknife:
    """Standard errors by leaving one of `segments` segments out and fitting again, `sd` (p,), and those `stated` and
    the `textbook`'s, (p,); nan where a bound holds a number or no row tells it."""

    sd: np.ndarray
    stated: np.ndarray
    textbook: np.ndarray
    segments: int

    @property
    def ratios(self) -> np.ndarray:
        """Stated over jackknife, of the numbers that have both."""
        both = np.isfinite(self.sd) & np.isfinite(self.stated) & (self.sd > 0.0) & (self.stated > 0.0)
        return self.stated[both] / self.sd[both]

    @property
    def share_within(self) -> float:
        """Share of numbers for which both agree within a factor of two [%]."""
        ratios = self.ratios
        return float(100.0 * np.mean((ratios < FACTOR) & (ratios > 1.0 / FACTOR))) if len(ratios) else float("nan")

    @property
    def textbook_ratio(self) -> float:
        """Jackknife over textbook, the median: how many times too small that is."""
        both = (self.textbook > 0.0) & np.isfinite(self.sd)
        return float(np.median(self.sd[both] / self.textbook[both]))


def segment_jackknife(
    model: TreeModel, rows: TreeRows, found: TreeSolution, covariance: np.ndarray, textbook: np.ndarray
) -> SegmentJackknife:
    """Of a solution with its `covariance` (p, p) and the `textbook`'s (p, p); the model stays as it is."""
    numbers = np.unique(rows.segment[rows.used.any(axis=1)])
    values = np.array([fit_rows(model, rows.only(numbers[numbers != n]), start=found)[0].values for n in numbers])
    sd = np.sqrt((len(numbers) - 1) / len(numbers) * np.sum((values - values.mean(axis=0)) ** 2, axis=0))
    free = found.seen & ~found.held
    stated, by_book = (np.where(free, np.sqrt(np.diag(c)), np.nan) for c in (covariance, textbook))
    return SegmentJackknife(np.where(free, sd, np.nan), stated, by_book, len(numbers))
