"""Swings that determine a pendulum's inertia and weight moment: the two sines of the paper `hill`, and better ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellucid._errors import IdentificationError
from pellucid.models.joint import GRAVITY

from ..fourier import FourierSeries, optimised_fourier

PUBLISHED_FREQUENCY = 0.1
"""Fundamental frequency f that the paper prints [Hz]."""

_INSTANTS_PER_PERIOD = 2000
"""Number of instants at which a period is evaluated."""

_ACCELERATION_LIMIT_COUNT = 8
"""Number of acceleration limits that are tried."""


def two_sines(amplitude: float, *, centre: float = 0.0, frequency: float = PUBLISHED_FREQUENCY) -> FourierSeries:
    """Return two sines of one amplitude, at a frequency and at twice that.

    `amplitude` [rad]; `centre` [rad]; `frequency` [Hz].
    """
    omega = 2.0 * np.pi * frequency
    return FourierSeries(frequency, centre, amplitude * omega * np.array([1.0, 2.0]), np.zeros(2))


@dataclass(frozen=True)
class SwingInformation:
    """Expected precision of a pendulum's parameters from one swing."""

    inertia_sd: float  # expected standard deviation of the inertia [kg m^2]
    weight_moment_sd: float  # expected standard deviation of the weight moment [kg m]
    correlation: float  # correlation between the torques of inertia and gravity
    condition: float  # condition number of the regressor of both
    inertia_share: float  # standard deviation of the inertial torque divided by that of gravity
    peak_torque: float  # largest torque of the swing [N m]


def swing_information(
    series: FourierSeries,
    inertia: float,
    weight_moment: float,
    *,
    noise: float,
    bandwidth: float,
    duration: float,
    friction: bool = False,
) -> SwingInformation:
    """Predict the precision of inertia and weight moment after a swing around the hanging position.

    `inertia` [kg m^2], `weight_moment` [kg m]; `noise` [N m]; `bandwidth` [Hz]; `duration` [s].
    """
    time = np.arange(_INSTANTS_PER_PERIOD) / _INSTANTS_PER_PERIOD * series.period
    matrix = _regressor(*series.motion(time), friction=friction)
    count = 2.0 * bandwidth * duration
    covariance = noise**2 / count * np.linalg.inv(matrix.T @ matrix / len(matrix))
    inertial, gravity = inertia * matrix[:, 0], weight_moment * matrix[:, 1]
    return SwingInformation(
        float(np.sqrt(covariance[0, 0])),
        float(np.sqrt(covariance[1, 1])),
        float(np.corrcoef(inertial, gravity)[0, 1]),
        float(np.linalg.cond(matrix[:, :2])),
        float(np.std(inertial) / np.std(gravity)),
        float(np.abs(inertial + gravity).max()),
    )


def optimise_swing(
    inertia: float,
    weight_moment: float,
    *,
    reach: float,
    peak_torque: float,
    rng: np.random.Generator,
    velocity: float = 3.0,
    acceleration: float = 10.0,
    fundamental: float = 0.1,
    harmonics: int = 10,
    friction: bool = False,
) -> FourierSeries:
    """Return the swing that determines both parameters best, given a range of angles and a motor.

    D-optimal Fourier series are computed for several limits of the acceleration. Of those within the motor's torque,
    the one with the smallest standard deviation of the inertia is chosen.

    `inertia`, `weight_moment` [kg m^2], [kg m]; `reach` [rad]; `peak_torque` [N m]; `velocity`, `acceleration`
    [rad/s], [rad/s^2]; `fundamental` [Hz].
    """
    best, least, lowest = None, np.inf, np.inf
    size = np.array([inertia, weight_moment, *([0.1 * weight_moment] * 3 if friction else [])])
    for limit in acceleration / 1.5 ** np.arange(_ACCELERATION_LIMIT_COUNT):
        series = optimised_fourier(
            lambda *motion: _regressor(*motion, friction=friction),
            fundamental=fundamental, harmonics=harmonics, low=-reach, high=reach, velocity=velocity,
            acceleration=float(limit), rng=rng, criterion="determinant", scales=size, restarts=2,
        )  # fmt: skip
        shown = swing_information(
            series, inertia, weight_moment, noise=1.0, bandwidth=1.0, duration=1.0, friction=friction
        )
        lowest = min(lowest, shown.peak_torque)
        if shown.peak_torque <= peak_torque and shown.inertia_sd < least:
            best, least = series, shown.inertia_sd
    if best is None:
        raise IdentificationError(
            f"found no swing of +-{np.degrees(reach):.3g} deg that needs less than {lowest:.3g} N*m, expected at most "
            f"{peak_torque:.3g} N*m; allow less reach, or a stronger motor"
        )
    return best


def _regressor(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, *, friction: bool) -> np.ndarray:
    """Return the terms of a swing, shape (n, k).

    NumPy's sine is used on purpose. The optimum is so flat that the core's sine, which differs in the last bit, would
    change it by micro-radians, and with it the recordings of the virtual rigs.
    """
    columns = [acceleration, GRAVITY * np.sin(position)]
    if friction:
        columns += [velocity, np.sign(velocity), np.ones_like(position)]
    return np.column_stack(columns)
