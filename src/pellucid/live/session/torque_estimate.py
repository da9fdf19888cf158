"""The torque on the robot, estimated from EMG while a session runs, with the interval that left-out trials give.

After each accepted trial a ridge regression is fitted again to the session's trials: from EMG levels, the angle's sine
and cosine and the velocity to the interaction torque that the robot measures. The interval is 1.96 times the RMS error
in trials that the fit did not see, one after another. It is a look while the person is there; `calibrate` fits and
judges the estimator that a robot may use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...emg.estimators.ridge import Ridge

MIN_TRIALS = 2
"""Number of trials below which nothing is estimated: one has to be left out."""

RATE_HZ = 20.0
"""Rate at which trials are fitted [Hz]."""

RIDGE_PENALTY = 1.0
"""Penalty of the ridge regression on standardised coefficients."""

INTERVAL_SD = 1.96
"""Half of the interval, in RMS errors: 95 % of normal errors."""


@dataclass(frozen=True)
class TorqueEstimate:
    """The torque now."""

    torque: float  # [N*m]
    half_width: float  # half of the 95 % interval [N*m]


class TorqueEstimator:
    """Fits trials, and estimates what follows."""

    def __init__(self) -> None:
        self._trials: list[tuple[np.ndarray, np.ndarray]] = []
        self._fit: Ridge | None = None
        self.error = float("nan")  # RMS error in left-out trials [N*m]
        self.error_of_mean = float("nan")  # RMS error of the other trials' mean there, the simplest rival [N*m]

    @property
    def is_useful(self) -> bool:
        """Whether the fit predicts left-out trials better than the other trials' mean does."""
        return self.error < self.error_of_mean

    @staticmethod
    def features(levels: Mapping[str, np.ndarray], position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return features, shape (n, muscles + 3), of samples of shape (n,) [1, rad, rad/s]."""
        emg = [np.asarray(levels[muscle], float) for muscle in sorted(levels)]
        return np.column_stack([*emg, np.sin(position), np.cos(position), np.asarray(velocity, float)])

    def add_trial(self, features: np.ndarray, torque: np.ndarray) -> None:
        """Add a trial: features (n, k) and the torque that the robot measured, (n,) [N*m]; fit again."""
        sound = np.isfinite(features).all(axis=1) & np.isfinite(torque)
        if sound.sum() < features.shape[1] + 2:
            return
        if self._trials and self._trials[0][0].shape[1] != features.shape[1]:
            return
        self._trials.append((features[sound], torque[sound]))
        if len(self._trials) < MIN_TRIALS:
            return
        errors, of_mean = [], []
        for i, (seen, wanted) in enumerate(self._trials):
            others = [trial for j, trial in enumerate(self._trials) if j != i]
            x, y = np.concatenate([t[0] for t in others]), np.concatenate([t[1] for t in others])
            errors.append(Ridge(RIDGE_PENALTY).fit(x, y).predict(seen) - wanted)
            of_mean.append(y.mean() - wanted)
        self.error = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
        self.error_of_mean = float(np.sqrt(np.mean(np.concatenate(of_mean) ** 2)))
        x, y = (np.concatenate([trial[k] for trial in self._trials]) for k in (0, 1))
        self._fit = Ridge(RIDGE_PENALTY).fit(x, y)

    def estimate(self, levels: Mapping[str, float], position: float, velocity: float) -> TorqueEstimate | None:
        """Return the torque now; None before enough trials, where a sample is missing, or where a mean does better."""
        if self._fit is None or not self.is_useful:
            return None
        one = {muscle: np.array([level]) for muscle, level in levels.items()}
        seen = self.features(one, np.array([position]), np.array([velocity]))
        if seen.shape[1] != self._fit.n_features_in_ or not np.isfinite(seen).all():
            return None
        return TorqueEstimate(float(self._fit.predict(seen)[0]), INTERVAL_SD * self.error)
