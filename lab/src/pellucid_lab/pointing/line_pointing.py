"""Virtual people who point at a line on a tablet without a robot, and the measures of their movements.

The forearm moves a stylus to the line by rotation about the elbow. The tablet is horizontal, so that gravity does not
act. Movements are cut from a recording by `one_way_movements.py`, as those of real people are.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from pellucid import _core

from .one_way_movements import OneWay, one_way_movements, robust_spread
from .people import Person, parameter_names, person_model
from .speed_accuracy import Accuracy, Aim

if TYPE_CHECKING:
    from .rig import PointingRig

MEASURE_NAMES = ("time", "spread", "first_time", "first_spread", "late_time")
"""Measures of a person's movements, in the order of every array.

Median duration [s], robust spread of the place where they end [m], median time to the first stop [s], robust spread of
that place [m], and the duration that a fifth of the movements exceed [s]."""

AIM_RANGES = {
    "duration": (0.10, 2.0),
    "dead_zone": (1.0, 150.0),
    "spread": (7e-4, 0.04),
    "correction": (0.06, 0.6),
    "resolution": (7e-5, 3e-3),
    "shortfall": (0.03, 0.5),
}
"""Smallest and largest value of each input of `OutcomeEmulator`.

Duration of the primary movement [s], dead zone over the eye's resolution [1], spread of the primary movement [m],
duration of a correction [s], resolution of the eye [m], and share of an error that a correction leaves [1]. Chosen by
judgement to contain all estimates; no measurement is recorded."""


@dataclass(frozen=True)
class Tablet:
    """A tablet with a start line and a target line."""

    distance: float = 0.150  # distance between the lines [m]
    lever: float = 0.40  # distance from the elbow to the stylus's tip, over forearm and hand [m]
    # Noise of the arm over that of a free forearm, because the stylus rubs on glass [1]. At rest virtual people then
    # move at 0.3 to 1.1 mm/s (RMS below 10 Hz), recorded people at 0.9 to 2 mm/s.
    unsteadiness: float = 0.25
    # Standard deviation, from movement to movement, of the logarithms of dead zone and correction time. Recorded
    # durations scatter by 0.2 to 0.45 under one instruction.
    unevenness: float = 0.3
    begins: float = 0.30  # start of the movement [s]
    watched: float = 3.0  # recorded time after the start [s]

    @property
    def angle(self) -> float:
        """Return the rotation of the elbow from line to line [rad]."""
        return self.distance / self.lever


def measure_movements(movements: Sequence[OneWay]) -> np.ndarray:
    """Return the `MEASURE_NAMES` of a person's movements, shape (5,); NaN for fewer than three movements."""
    if len(movements) < 3:
        return np.full(len(MEASURE_NAMES), np.nan)
    durations = np.array([one.duration for one in movements])
    end_places = np.array([one.place for one in movements])
    first_times = np.array([one.first_stop - one.onset for one in movements])
    first_places = np.array([one.first_place for one in movements])
    return np.array(
        [
            np.median(durations),
            robust_spread(end_places),
            np.median(first_times),
            robust_spread(first_places),
            np.quantile(durations, 0.8),
        ]
    )


def point_at_line(
    rig: PointingRig,
    person: Person,
    aimed: Aim,
    accuracy: Accuracy,
    *,
    count: int,
    tablet: Tablet | None = None,
    seed: int = 1,
) -> list[OneWay]:
    """Simulate `count` movements of a person with an aim, and return those that `one_way_movements` finds.

    The same seed gives the same noise for every aim.
    """
    tablet = tablet or Tablet()
    names, vector = parameter_names(rig), _on_tablet(rig, person, aimed, accuracy, tablet)
    longest = round((tablet.begins + tablet.watched) / rig.period)
    # Primary errors are quantiles of their distribution in random order, which needs fewer movements than random
    # errors.
    errors = aimed.spread * np.random.default_rng(seed).permutation(ndtri((np.arange(count) + 0.5) / count))
    rng = np.random.default_rng(seed + 1)
    paces = aimed.duration * np.exp(rig["planning"]["pace_spread"] * rng.standard_normal(count))
    noise = rng.standard_normal((longest, 5))
    found = []
    factors = np.exp(tablet.unevenness * rng.standard_normal((count, 2)))
    for error, pace, (zone_factor, time_factor) in zip(errors, paces, factors, strict=True):
        vector[names.index("tolerance")] = zone_factor * aimed.dead_zone
        vector[names.index("correction_least")] = time_factor * accuracy.correction
        noise = np.roll(noise, 1009, axis=0)
        place = tablet.lever * _simulate_movement(rig, vector, tablet, error, pace, noise)
        found += one_way_movements(rig.period * np.arange(len(place)), place)[:1]
    return found


def _on_tablet(rig: PointingRig, person: Person, aimed: Aim, accuracy: Accuracy, tablet: Tablet) -> np.ndarray:
    """Return the core's parameters of a person who draws on a tablet, shape (k,)."""
    names, vector = parameter_names(rig), person.vector(rig)
    changed = {
        "gravity": 0.0,
        "centre": 0.0,
        "passive_torque": 0.0,
        "tolerance": aimed.dead_zone,
        "visual_delay": accuracy.visual_delay,
        "visual_noise": accuracy.resolution,
        "correction_least": accuracy.correction,
        "correction_share": 0.0,
        "correction_gain": 1.0 - accuracy.shortfall,
    }
    for name, value in changed.items():
        vector[names.index(name)] = value
    vector[names.index("noise_share")] *= tablet.unsteadiness
    return vector


def _simulate_movement(
    rig: PointingRig,
    vector: np.ndarray,
    tablet: Tablet,
    error: float,
    duration: float,
    noise: np.ndarray,
) -> np.ndarray:
    """Return the forearm's angle during one movement from line to line, shape (n,) [rad].

    The primary movement misses the target by `error` [rad].
    """
    arm = _core.WornElbow(
        vector, np.zeros(5), position0=0.0, strap=rig.strap, drive=np.ones(5), emg_gains=np.ones(2), substeps=2,
        person=person_model(rig),
    )  # fmt: skip
    amplitude = rig["planning"]["reach"] * tablet.angle + error
    return arm.move(
        target=tablet.angle, amplitude=amplitude, duration=duration, reaction=tablet.begins,
        load=np.zeros(5), tolerance=1e3, hold=tablet.watched, noise=noise, longest=len(noise),
    )[0]  # fmt: skip


@dataclass(frozen=True)
class OutcomeEmulator:
    """An emulator of `measure_movements`: Gaussian processes over aims and traits, fitted to simulated movements.

    Calling it with an `Aim` and an `Accuracy` returns the logarithms of the measures without a simulation.
    """

    inputs: np.ndarray  # (n, 6) logarithms of the inputs of `AIM_RANGES`, 0 to 1 over each range
    logs: np.ndarray  # (n, 5) logarithms of `MEASURE_NAMES`
    tablet: Tablet

    @classmethod
    def fit_to_simulation(
        cls, rig: PointingRig, person: Person, *, points: int = 768, count: int = 64, seed: int = 1
    ) -> Self:
        """Fit an emulator to a person of a rig: `count` movements at each of `points` points of a Latin hypercube."""
        tablet = Tablet()
        inputs = qmc.LatinHypercube(len(AIM_RANGES), rng=seed).random(points)
        logs = []
        for point in inputs:
            duration, zone, spread, correction, resolution, shortfall = _values(point)
            aimed = Aim(duration, spread / tablet.lever, zone * resolution / tablet.lever)
            accuracy = Accuracy(0.0, resolution / tablet.lever, correction, rig["vision"]["delay"], shortfall)
            logs.append(
                measure_movements(point_at_line(rig, person, aimed, accuracy, count=count, tablet=tablet, seed=seed))
            )
        logs = np.log(np.maximum(np.array(logs), 1e-6))
        whole = np.isfinite(logs).all(axis=1)
        return cls(inputs[whole], logs[whole], tablet)

    @cached_property
    def _processes(self) -> list[tuple[np.ndarray, np.ndarray, float, float]]:
        """Return a Gaussian process for each of `MEASURE_NAMES`: weights, length scales, variance and mean."""
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

        made = []
        for column in self.logs.T:
            kernel = ConstantKernel(1.0, (0.01, 100.0)) * RBF(np.full(len(AIM_RANGES), 0.5), (0.05, 50.0))
            model = GaussianProcessRegressor(kernel + WhiteKernel(0.05, (1e-5, 1.0)))
            mean = float(column.mean())
            with warnings.catch_warnings():
                # An input without effect on a measure has its length scale on the bound, which is correct.
                warnings.simplefilter("ignore", ConvergenceWarning)
                model.fit(self.inputs, column - mean)
            part = model.kernel_.k1
            made.append((model.alpha_, part.k2.length_scale, part.k1.constant_value, mean))
        return made

    def __call__(self, aimed: Aim, accuracy: Accuracy) -> np.ndarray:
        """Return the logarithms of `MEASURE_NAMES`, shape (5,); inputs beyond `AIM_RANGES` count as on its border."""
        lever = self.tablet.lever
        values = (aimed.duration, aimed.dead_zone / accuracy.resolution, lever * aimed.spread, accuracy.correction)
        point = _inputs((*values, lever * accuracy.resolution, accuracy.shortfall))
        away = self.inputs - np.clip(point, 0.0, 1.0)
        return np.array(
            [mean + size * np.exp(-0.5 * ((away / scale) ** 2).sum(axis=1)) @ weights
             for weights, scale, size, mean in self._processes]
        )  # fmt: skip


_LOG_RANGE_STARTS, _LOG_RANGE_ENDS = np.log(np.array(list(AIM_RANGES.values()))).T
"""Logarithms of the smallest and of the largest value of each input, shape (6,)."""


def _values(point: np.ndarray) -> np.ndarray:
    """Return the inputs at a point of the unit cube, shape (6,)."""
    return np.exp(_LOG_RANGE_STARTS + (_LOG_RANGE_ENDS - _LOG_RANGE_STARTS) * point)


def _inputs(values: Sequence[float]) -> np.ndarray:
    """Return the point of the unit cube that belongs to inputs, shape (6,)."""
    return (np.log(values) - _LOG_RANGE_STARTS) / (_LOG_RANGE_ENDS - _LOG_RANGE_STARTS)
