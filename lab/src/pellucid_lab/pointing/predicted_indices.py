"""Catalogue of the indices that are predicted: words, a session's value, and how a change from control is made.

Changes are made as publications make them: of the mean over people; of EMG the mean of each person's own, since
nobody's amplitude means anything in another; of a median duration the median of each person's own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pellucid.people.indices import (
    EMG_PER_ACCELERATION,
    MEDIAN_DURATION,
    MOVEMENT_DURATION,
    PEAK_VELOCITY,
    UNSETTLED_SHARE,
    leading_index,
)

from .session_indices import PUBLISHED_RULE, SessionIndices


def change_of_mean(worn: np.ndarray, control: np.ndarray) -> np.ndarray:
    """Return the change of the mean over people, who are the last axis, from control [%]."""
    return 100.0 * (np.mean(worn, axis=-1) / np.mean(control, axis=-1) - 1.0)


def mean_change(worn: np.ndarray, control: np.ndarray) -> np.ndarray:
    """Return the mean of each person's own change, people being the last axis [%]."""
    return 100.0 * (np.mean(worn / control, axis=-1) - 1.0)


def median_change(worn: np.ndarray, control: np.ndarray) -> np.ndarray:
    """Return the median of each person's own change, people being the last axis [%]."""
    return 100.0 * (np.median(worn / control, axis=-1) - 1.0)


def mean_share(worn: np.ndarray, control: np.ndarray) -> np.ndarray:
    """Return the mean over people, who are the last axis, of a share itself, whatever it is in control [%]."""
    return 100.0 * np.mean(worn, axis=-1)


@dataclass(frozen=True)
class PredictedIndex:
    """One predicted index."""

    name: str  # name in ids of rows
    words: str  # name in tables
    value: Callable[[SessionIndices], float]  # value of a session
    change: Callable[[np.ndarray, np.ndarray], np.ndarray]  # change from control [%] of values worn and in control
    is_screened: bool = False  # whether it is shown which factors decide it

    def own_change(self, worn: np.ndarray, control: np.ndarray) -> np.ndarray:
        """Return the change of every pair of values by itself, shape as given [%]."""
        return self.change(worn[..., None], control[..., None])


def _mean_duration(found: SessionIndices) -> float:
    """Return the mean duration of movements that ended [s]; their median, a bound from below, where none did."""
    means = found.means[PUBLISHED_RULE]
    return means.duration if np.isfinite(means.duration) else means.duration_median


PREDICTED_INDICES: tuple[PredictedIndex, ...] = (
    PredictedIndex(MOVEMENT_DURATION.name, "mean duration", _mean_duration, change_of_mean),
    PredictedIndex(
        MEDIAN_DURATION.name, "median duration", lambda found: found.means[PUBLISHED_RULE].duration_median,
        median_change, is_screened=True,
    ),
    PredictedIndex(
        PEAK_VELOCITY.name, "peak velocity", lambda found: found.means[PUBLISHED_RULE].vmax,
        change_of_mean, is_screened=True,
    ),
    PredictedIndex(
        EMG_PER_ACCELERATION.of, "EMG/Acc", lambda found: found.means[PUBLISHED_RULE].emg_per_acc,
        mean_change, is_screened=True,
    ),
    PredictedIndex(
        "antagonists", "antagonists' EMG", lambda found: found.means[PUBLISHED_RULE].antagonists, mean_change
    ),
    PredictedIndex(UNSETTLED_SHARE.name, "never settled", lambda found: found.unsettled, mean_share),
)  # fmt: skip
"""Every predicted index, in the order of arrays and tables."""

PREDICTED_INDICES_BY_NAME = {index.name: index for index in PREDICTED_INDICES}


def leading_predicted_index() -> PredictedIndex:
    """Return the predicted index that an assessment of the study tests first."""
    return PREDICTED_INDICES_BY_NAME[leading_index().name]


def change(index: str, worn: np.ndarray, control: np.ndarray) -> np.ndarray:
    """Return the change of the index of this name from control [%]; people are the last axis of both arrays."""
    return PREDICTED_INDICES_BY_NAME[index].change(worn, control)
