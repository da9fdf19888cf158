r"""What a swing can say of inertia and gravity before it is recorded, and one that says more.

Torque noise of standard deviation s and band B, seen for a time D, is worth 2 B D independent samples. The covariance
of inertia and weight moment is then

.. math::  C = \frac{s^2}{2 B D} \left( \overline{w w^T} \right)^{-1}, \qquad w = (\ddot\theta, \, g \sin\theta, \ldots)

averaged over a period.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import GRAVITY
from ...protocols.fourier import FourierSeries, optimised_fourier

_INSTANTS = 2000  # of a period
_STEPS = 8  # acceleration limits tried


@dataclass(frozen=True)
class SwingInformation:
    """What a swing shows of a pendulum."""

    inertia_sd: float  # inertia_sd, weight_moment_sd: Standard deviations to expect [kg m^2], [kg m]
    weight_moment_sd: float
    correlation: float  # Of the torques that inertia and gravity take
    condition: float  # Of the regressor of both
    inertia_share: float  # Effective torque of the inertia, over that of gravity
    peak_torque: float  # [N m]


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
    """How sure inertia and weight moment can be after a swing about where the body hangs. `inertia`, `weight_moment`
    [kg m^2], [kg m]; `noise` [N m]; `bandwidth` [Hz]; `duration` [s]."""
    time = np.arange(_INSTANTS) / _INSTANTS * series.period
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


def better_swing(
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
    """A swing that shows both as well as a range of angles and a motor allow.

    D-optimal Fourier series for a few limits of the acceleration; the one that shows the inertia best of those that
    need no more torque than there is.

    `inertia`, `weight_moment` [kg m^2], [kg m]; `reach` [rad]; `peak_torque` [N m]; `velocity`, `acceleration`
    [rad/s], [rad/s^2]; `fundamental` [Hz].
    """
    best, least, lowest = None, np.inf, np.inf
    size = np.array([inertia, weight_moment, *([0.1 * weight_moment] * 3 if friction else [])])
    for limit in acceleration / 1.5 ** np.arange(_STEPS):
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
    """A swing's terms, (n, k). With NumPy's sine: the optimum is so flat that the core's, a last bit away, moves it by
    micro-radians, and what virtual rigs recorded with it would be another recording."""
    columns = [acceleration, GRAVITY * np.sin(position)]
    if friction:
        columns += [velocity, np.sign(velocity), np.ones_like(position)]
    return np.column_stack(columns)
