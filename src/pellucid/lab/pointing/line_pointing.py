"""Virtual people who point at a line without a robot, and what instruments of such a study measure of them.

A stylus is moved to a line on a horizontal tablet by the forearm about the elbow: gravity has no part in it. The
movements are cut as people's are, by `signals.one_way_movements`.
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

from ... import _core
from ...signals.one_way_movements import OneWay, one_way_movements, robust_spread
from .people import Person, parameter_names, person_model
from .speed_accuracy import Accuracy, Aim

if TYPE_CHECKING:
    from .rig import PointingRig

MEASURE_NAMES = ("time", "spread", "first_time", "first_spread", "late_time")
"""Of a person's movements: median duration [s], robust spread of where they ended [m], median time to the first stop
[s] and spread of that place [m], and the duration that a fifth of them exceed [s]."""

AIM_RANGES = {
    "duration": (0.10, 2.0),
    "dead_zone": (1.0, 150.0),
    "spread": (7e-4, 0.04),
    "correction": (0.06, 0.6),
    "resolution": (7e-5, 3e-3),
    "shortfall": (0.03, 0.5),
}
"""Within which aims and traits are tried: primary duration [s], dead zone over what can be resolved [1], spread of the
primary movement [m], a correction's duration [s], what can be resolved [m], what a correction leaves of an error
[1]."""


@dataclass(frozen=True)
class Tablet:
    """A tablet with a start line and a target line."""

    distance: float = 0.150  # Between the lines [m]
    lever: float = 0.40  # From the elbow to the stylus's tip [m]: a forearm, and a hand that holds a stylus
    # Of what shakes a free forearm, so much is left to a stylus that rubs on glass: at rest these people have speeds of
    # 0.3 to 1.1 mm/s (root mean square, below 10 Hz), those who were recorded of 0.9 to 2
    unsteadiness: float = 0.25
    # Standard deviation of the logarithm, from movement to movement, of what is left as it is and of how long a
    # correction takes: people's durations scatter by 0.2 to 0.45 under one instruction
    unevenness: float = 0.3
    begins: float = 0.30  # When it begins [s]
    watched: float = 3.0  # After that [s]

    @property
    def angle(self) -> float:
        """Between the lines, about the elbow [rad]."""
        return self.distance / self.lever


def measure_movements(movements: Sequence[OneWay]) -> np.ndarray:
    """`MEASURE_NAMES` of somebody's movements, shape (5,); NaN where there are less than three."""
    if len(movements) < 3:
        return np.full(len(MEASURE_NAMES), np.nan)
    took = np.array([one.duration for one in movements])
    place = np.array([one.place for one in movements])
    first = np.array([one.first_stop - one.onset for one in movements])
    there = np.array([one.first_place for one in movements])
    spreads = robust_spread(place), robust_spread(there)
    return np.array([np.median(took), spreads[0], np.median(first), spreads[1], np.quantile(took, 0.8)])


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
    """Movements of a person who moves as `aimed`, of `count` that were tried; the same seed has the same noise."""
    tablet = tablet or Tablet()
    names, vector = parameter_names(rig), _on_tablet(rig, person, aimed, accuracy, tablet)
    longest = round((tablet.begins + tablet.watched) / rig.period)
    # Primary errors are spread evenly over their distribution, so that few movements tell much.
    errors = aimed.spread * np.random.default_rng(seed).permutation(ndtri((np.arange(count) + 0.5) / count))
    rng = np.random.default_rng(seed + 1)
    paces = aimed.duration * np.exp(rig["planning"]["pace_spread"] * rng.standard_normal(count))
    noise = rng.standard_normal((longest, 5))
    found = []
    uneven = np.exp(tablet.unevenness * rng.standard_normal((count, 2)))
    for error, pace, (content, hurry) in zip(errors, paces, uneven, strict=True):
        vector[names.index("tolerance")] = content * aimed.dead_zone
        vector[names.index("correction_least")] = hurry * accuracy.correction
        noise = np.roll(noise, 1009, axis=0)
        place = tablet.lever * _moved(rig, vector, tablet, error, pace, noise)
        found += one_way_movements(rig.period * np.arange(len(place)), place)[:1]
    return found


def _on_tablet(rig: PointingRig, person: Person, aimed: Aim, accuracy: Accuracy, tablet: Tablet) -> np.ndarray:
    """The core's parameters of a person who draws on a tablet, shape (k,)."""
    names, vector = parameter_names(rig), person.vector(rig)
    said = {"gravity": 0.0, "centre": 0.0, "passive_torque": 0.0, "tolerance": aimed.dead_zone}
    said |= {"visual_delay": accuracy.visual_delay, "visual_noise": accuracy.resolution}
    said |= {
        "correction_least": accuracy.correction,
        "correction_share": 0.0,
        "correction_gain": 1.0 - accuracy.shortfall,
    }
    for name, value in said.items():
        vector[names.index(name)] = value
    vector[names.index("noise_share")] *= tablet.unsteadiness
    return vector


def _moved(
    rig: PointingRig,
    vector: np.ndarray,
    tablet: Tablet,
    error: float,
    duration: float,
    noise: np.ndarray,
) -> np.ndarray:
    """The forearm's angle, shape (n,) [rad], of one movement from line to line whose primary part is off by an error
    [rad]."""
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
    """What is measured of a virtual person's movements, by how they are aimed: learnt from many that were simulated."""

    inputs: np.ndarray  # (n, 6) Logarithms of `AIM_RANGES`, in units of those ranges
    logs: np.ndarray  # (n, 5) Of `MEASURE_NAMES`
    tablet: Tablet

    @classmethod
    def simulated(cls, rig: PointingRig, person: Person, *, points: int = 768, count: int = 64, seed: int = 1) -> Self:
        """Of a person of a rig, at so many points of a Latin hypercube over `AIM_RANGES`, so many movements at each."""
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
    def _learnt(self) -> list[tuple[np.ndarray, np.ndarray, float, float]]:
        """A Gaussian process for each of `MEASURE_NAMES`: weights, length scales, and the mean that they are about."""
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

        made = []
        for column in self.logs.T:
            kernel = ConstantKernel(1.0, (0.01, 100.0)) * RBF(np.full(len(AIM_RANGES), 0.5), (0.05, 50.0))
            model = GaussianProcessRegressor(kernel + WhiteKernel(0.05, (1e-5, 1.0)))
            mean = float(column.mean())
            with warnings.catch_warnings():
                # What does not matter to a measure has a length at the border, and that is as it should be.
                warnings.simplefilter("ignore", ConvergenceWarning)
                model.fit(self.inputs, column - mean)
            part = model.kernel_.k1
            made.append((model.alpha_, part.k2.length_scale, part.k1.constant_value, mean))
        return made

    def __call__(self, aimed: Aim, accuracy: Accuracy) -> np.ndarray:
        """Logarithms of `MEASURE_NAMES`, shape (5,); beyond `AIM_RANGES` as at their border."""
        lever = self.tablet.lever
        values = (aimed.duration, aimed.dead_zone / accuracy.resolution, lever * aimed.spread, accuracy.correction)
        point = _inputs((*values, lever * accuracy.resolution, accuracy.shortfall))
        away = self.inputs - np.clip(point, 0.0, 1.0)
        return np.array(
            [mean + size * np.exp(-0.5 * ((away / scale) ** 2).sum(axis=1)) @ weights
             for weights, scale, size, mean in self._learnt]
        )  # fmt: skip


_LOG_RANGE_STARTS, _LOG_RANGE_ENDS = np.log(np.array(list(AIM_RANGES.values()))).T


def _values(point: np.ndarray) -> np.ndarray:
    return np.exp(_LOG_RANGE_STARTS + (_LOG_RANGE_ENDS - _LOG_RANGE_STARTS) * point)


def _inputs(values: Sequence[float]) -> np.ndarray:
    return (np.log(values) - _LOG_RANGE_STARTS) / (_LOG_RANGE_ENDS - _LOG_RANGE_STARTS)
