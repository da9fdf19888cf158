"""The ranking of one task's controllers, with the test whether they differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats

from pellucid.people.comparison import FriedmanTest

from .tried import ControllerTrial

SIGNIFICANCE_LEVEL = 0.05
"""Significance level of Nemenyi's test. A controller that does not differ from the first shares its place [1]."""


MIN_INTERVAL_PAIRS = 5
"""Fewest pairs for which a range of 80 % of them is reported; with fewer it would be the full range."""


@dataclass(frozen=True, eq=False)
class TaskRanking:
    """The controllers of one task, from the first to the last."""

    task: str
    controllers: tuple[str, ...]  # names in the order of the mean rank over pairs, ties by the median torque
    torque: np.ndarray  # RMS torque, shape (pairs, controllers) [N m]; infinite if the person never arrived
    ranks: np.ndarray  # mean rank over pairs, shape (controllers,) [1]
    test: FriedmanTest | None  # test whether the controllers differ at all; None with one pair
    like_first: np.ndarray  # whether each does not differ from the first by Nemenyi's test, shape (controllers,)
    tried: Mapping[str, tuple[ControllerTrial, ...]]  # results of each controller, one per pair

    @property
    def has_interval(self) -> bool:
        """Whether there are pairs enough to say within which range most of them lie."""
        return len(self.torque) >= MIN_INTERVAL_PAIRS

    def over(self, rival: str) -> np.ndarray:
        """Return the torque of every controller divided by a reference controller's, shape (pairs, controllers) [1]."""
        return self.torque / self.torque[:, [self.controllers.index(rival)]]

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return the 10 % quantile, median and 90 % quantile of `values` over pairs, shape (3, controllers)."""
        low, high = np.quantile(values, (0.1, 0.9), axis=0, method="inverted_cdf")
        return np.stack([low, np.median(values, axis=0), high])

    @property
    def critical(self) -> float:
        """Smallest difference of mean ranks that is significant in Nemenyi's test [1]."""
        pairs, k = self.torque.shape
        quantile = float(stats.studentized_range.ppf(1.0 - SIGNIFICANCE_LEVEL, k, np.inf)) / np.sqrt(2.0)
        return quantile * float(np.sqrt(k * (k + 1) / (6.0 * pairs)))
