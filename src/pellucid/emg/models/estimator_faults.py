"""Catalogue of the faults that a live estimator of torque reports: words, and whether the estimate is still good.

The core's ``emg_estimator.hpp`` has their names and their order, from the least to the gravest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ... import _core


@dataclass(frozen=True)
class EstimatorFault:
    """A fault of a live estimator."""

    name: str  # name of the core
    words: str  # what was found and what the estimator then does
    keeps_validity: bool = False  # whether the estimate is as good as the calibration in spite of it


ESTIMATOR_FAULTS: tuple[EstimatorFault, ...] = (
    EstimatorFault(_core.EMG_FAULTS[0], "as good as its calibration", keeps_validity=True),
    EstimatorFault("configuration", "the configuration makes no sense: every torque is 0"),
    EstimatorFault("time", "the time did not go on: the last answer once more"),
    EstimatorFault("angle", "an angle is lost, or was never heard: every torque is 0"),
    EstimatorFault("channel", "a channel is lost, and taken for a muscle at rest"),
    EstimatorFault("ceiling", "an envelope is above what a muscle gives, and was cut off"),
    EstimatorFault("limit", "a torque was beyond its limit, and was cut off"),
    EstimatorFault(
        "restarted", "the first step, or the first after a gap: lags and rates begin anew", keeps_validity=True
    ),
    EstimatorFault("changed", "a channel changed since the calibration: its pattern by the movement takes its place"),
    EstimatorFault("unlike", "most channels changed, or the movement is unlike the calibration: every torque is 0"),
)
"""Every fault, in the core's order."""

ESTIMATOR_FAULTS_BY_NAME: Mapping[str, EstimatorFault] = {fault.name: fault for fault in ESTIMATOR_FAULTS}
