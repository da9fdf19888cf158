"""Jackknife over segments, an independent check of the stated standard errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .tree_regression import TreeModel, TreeRows, TreeSolution, fit_rows

AGREEMENT_FACTOR = 2.0
"""A stated standard error agrees with the jackknife's if their ratio is within this factor."""


@dataclass(frozen=True)
class SegmentJackknife:
    """Standard errors by the jackknife, compared with stated ones; nan for parameters on a bound or undetermined."""

    sd: np.ndarray  # jackknife standard errors, (p,)
    stated: np.ndarray  # stated standard errors, (p,)
    textbook: np.ndarray  # standard errors for white residuals, (p,)
    segments: int  # number of segments

    @property
    def ratios(self) -> np.ndarray:
        """Stated over jackknife standard errors, of the parameters that have both."""
        both = np.isfinite(self.sd) & np.isfinite(self.stated) & (self.sd > 0.0) & (self.stated > 0.0)
        return self.stated[both] / self.sd[both]

    @property
    def share_within(self) -> float:
        """Share of parameters for which both agree within `AGREEMENT_FACTOR` [%]."""
        ratios = self.ratios
        return (
            float(100.0 * np.mean((ratios < AGREEMENT_FACTOR) & (ratios > 1.0 / AGREEMENT_FACTOR)))
            if len(ratios)
            else float("nan")
        )

    @property
    def textbook_ratio(self) -> float:
        """Median ratio of jackknife to textbook standard errors."""
        both = (self.textbook > 0.0) & np.isfinite(self.sd)
        return float(np.median(self.sd[both] / self.textbook[both]))


def jackknife_segments(
    model: TreeModel, rows: TreeRows, found: TreeSolution, covariance: np.ndarray, textbook: np.ndarray
) -> SegmentJackknife:
    """Compute the jackknife of a solution with its `covariance`, (p, p), and the `textbook` one, (p, p).

    The model is not chosen again.
    """
    numbers = np.unique(rows.segment[rows.used.any(axis=1)])
    values = np.array([fit_rows(model, rows.only(numbers[numbers != n]), start=found)[0].values for n in numbers])
    sd = np.sqrt((len(numbers) - 1) / len(numbers) * np.sum((values - values.mean(axis=0)) ** 2, axis=0))
    free = found.seen & ~found.held
    stated, by_book = (np.where(free, np.sqrt(np.diag(c)), np.nan) for c in (covariance, textbook))
    return SegmentJackknife(np.where(free, sd, np.nan), stated, by_book, len(numbers))
