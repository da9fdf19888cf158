r"""Offset of a limb's axis from a robot's, from the travel of a free carriage while both turn.

A limb of length L between its own axis and the cuff, whose axis lies at (a, b) from the robot's, holds the carriage at

.. math::
    x(q) = \sqrt{L^2 - (a \sin q - b \cos q)^2} + a \cos q + b \sin q \approx L + a \cos q + b \sin q

at the robot's angle q, while the limb itself is at another angle than the robot, by (a sin q - b cos q) / L. Each of
the two tells one coordinate well over a part of a turn. What else moves carriage and markers is fitted with them, each
as large as people and straps may be: an axis that wanders with the angle, one that is tilted, and skin that gives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...numerics.filters import runs

FREE_CARRIAGE_NAME = "free_carriage"
"""Protocol of recordings in which a wearer moves slowly and the carriage slides freely, as study.toml names it."""


@dataclass(frozen=True)
class AxisOffsetPriors:
    """What is assumed of skin, markers and a limb's axis."""

    # Prior standard deviation of how far a limb's axis moves per angle, along either direction [m/rad].
    axis_travel_sd_m_rad: float = 0.002
    # Prior standard deviation of how far its path bends per square of the angle [m/rad^2].
    axis_bend_sd_m_rad2: float = 0.001
    # Prior standard deviation of what a tilted axis adds to the carriage's travel twice a turn [m]. An axis tilted by β
    # adds L (1 - cos β) / 2: 1.9 mm for 10 degrees and 0.25 m.
    tilt_sd_m: float = 0.0015
    creep_sd_m: float = 0.002  # Prior standard deviation of how far skin gives before the carriage slides [m]
    limb_gain_sd: float = 0.01  # Prior standard deviation of how much skin turns a limb's markers per angle [1]
    min_range_rad: float = 0.7  # Smallest range of angles over which an axis can be told from a limb's length [rad]
    # Speed above which the carriage slides in its direction [m/s]; below it the last direction holds.
    sliding_speed_m_s: float = 0.001
    min_error_m: float = 5e-4  # Smallest error that is believed of skin and markers beyond what is fitted [m]
    # Largest number of errors of a recording that are believed to be independent [1]: skin repeats its errors.
    max_independent_errors: float = 50.0
    iteration_count: int = 6  # Number of linearised fits, each about the axis of the one before
    coverage_factor: float = 1.96  # Half the width of an interval of 95 % in standard deviations [1]


PRIORS = AxisOffsetPriors()


@dataclass(frozen=True)
class AxisOffset:
    """Place of a limb's axis in the robot's plane, at the middle of the recorded range of angles."""

    along: float  # towards the limb at a robot's angle of 0 [m]
    across: float  # towards the limb at a robot's angle of 90 degrees [m]
    covariance: np.ndarray  # (2, 2), of both [m^2]
    length: float  # from the limb's axis to the cuff [m]

    @property
    def distance(self) -> float:
        """Return the distance of both axes [m]."""
        return float(np.hypot(self.along, self.across))

    @property
    def interval(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the 95 % intervals of `along` and of `across` [m]."""
        half = PRIORS.coverage_factor * np.sqrt(np.diag(self.covariance))
        return (
            (self.along - float(half[0]), self.along + float(half[0])),
            (self.across - float(half[1]), self.across + float(half[1])),
        )


def estimate_axis_offset(position: np.ndarray, carriage: np.ndarray, limb: np.ndarray, fs: float) -> AxisOffset:
    """Return the offset of a limb's axis from the robot's, from recordings of slow movements with a free carriage.

    Parameters
    ----------
    position : ndarray
        Robot's angle, (n,) [rad].
    carriage : ndarray
        Distance of the carriage from the robot's axis along its link, (n,) [m], as markers tell it; low-passed.
    limb : ndarray
        Limb's angle in the robot's plane, (n,) [rad], as markers or inertial sensors tell it; its zero is not needed.
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    AxisOffset

    Raises
    ------
    IdentificationError
        If the shapes differ, samples are missing, or the joint turns by less than `PRIORS.min_range_rad`.

    Examples
    --------
    >>> import numpy as np
    >>> from pellucid.joint.slider.axis_offset import estimate_axis_offset
    >>> theta = 1.2 + 0.6 * np.sin(np.arange(3000) / 100.0)
    >>> cuff = 0.25 * np.exp(1j * theta) + 0.010 - 0.004j
    >>> found = estimate_axis_offset(np.angle(cuff), np.abs(cuff), theta, 100.0)
    >>> round(1e3 * found.along), round(1e3 * found.across)
    (10, -4)
    """
    q, x, theta = (np.asarray(samples, float) for samples in (position, carriage, limb))
    if q.ndim != 1 or not q.shape == x.shape == theta.shape:
        raise IdentificationError(
            f"axis offset: found shapes {q.shape}, {x.shape} and {theta.shape}, expected (n,) for all three"
        )
    if not (np.isfinite(q) & np.isfinite(x) & np.isfinite(theta)).all():
        raise IdentificationError("axis offset: found missing samples, expected a stretch without any")
    turned = float(np.ptp(q)) if len(q) else 0.0
    if not turned >= PRIORS.min_range_rad:
        raise IdentificationError(
            f"axis offset: found a range of {turned:.2g} rad, expected at least {PRIORS.min_range_rad:g} rad to "
            "distinguish the offset of the axis from the length of the limb"
        )
    middle = q - 0.5 * (q.min() + q.max())
    nothing, one, sliding = np.zeros(len(q)), np.ones(len(q)), _sliding_direction(x, fs)
    cuff, axis = x * np.exp(1j * q), 0j
    turn = PRIORS.limb_gain_sd * float(np.mean(x))
    prior_sd = np.array(
        [1.0] * 4
        + [PRIORS.axis_travel_sd_m_rad] * 2
        + [PRIORS.axis_bend_sd_m_rad2] * 2
        + [PRIORS.tilt_sd_m] * 2
        + [PRIORS.creep_sd_m, turn, 0.5 * turn]
    )
    variances = [PRIORS.min_error_m**2 * len(q) / PRIORS.max_independent_errors] * 2
    for _ in range(PRIORS.iteration_count):
        reach, angle = np.abs(cuff - axis), np.unwrap(np.angle(cuff - axis))
        length, cosine, sine = float(np.mean(reach)), np.cos(angle), np.sin(angle)
        # Along the limb and across it: axis, length, zero of the limb's angle, path of the axis, its tilt, creeping
        # skin, turning skin.
        along = [
            cosine, sine, one, nothing, middle * cosine, middle * sine, middle**2 * cosine, middle**2 * sine,
            np.cos(2.0 * angle), np.sin(2.0 * angle), sliding, nothing, nothing,
        ]  # fmt: skip
        across = [
            -sine, cosine, nothing, one, -middle * sine, middle * cosine, -(middle**2) * sine, middle**2 * cosine,
            -np.sin(2.0 * angle), np.cos(2.0 * angle), nothing, middle, middle**2,
        ]  # fmt: skip
        sides = ((np.column_stack(along), reach), (np.column_stack(across), length * (angle - theta)))
        precision, projected = np.diag(prior_sd**-2.0), np.zeros(len(prior_sd))
        for (columns, seen), variance in zip(sides, variances, strict=True):
            precision = precision + columns.T @ columns / variance
            projected = projected + columns.T @ seen / variance
        values = np.linalg.solve(precision, projected)
        axis += values[0] + 1j * values[1]
        # Neighbouring errors are alike: as many samples count as there are independent ones.
        errors = [seen - columns @ values for columns, seen in sides]
        alike = len(q) / PRIORS.max_independent_errors
        variances = [max(float(np.mean(e**2)) * _samples_per_error(e), PRIORS.min_error_m**2 * alike) for e in errors]
    return AxisOffset(axis.real, axis.imag, np.linalg.inv(precision)[:2, :2], float(values[2]))


def _sliding_direction(carriage: np.ndarray, fs: float) -> np.ndarray:
    """Return the direction in which the carriage slides or slid last, (n,), -1 to 1."""
    speed = np.gradient(carriage) * fs
    slides = np.abs(speed) > PRIORS.sliding_speed_m_s
    last = np.maximum.accumulate(np.where(slides, np.arange(len(speed)), -1))
    return np.where(last >= 0, np.sign(speed)[np.maximum(last, 0)], 0.0)


def _samples_per_error(errors: np.ndarray) -> float:
    """Return the number of neighbouring samples that tell as much as one: the mean length of runs of one sign."""
    lengths = [part.stop - part.start for sign in (errors > 0.0, errors <= 0.0) for part in runs(sign)]
    return 2.0 * float(np.mean(np.square(lengths)) / np.mean(lengths)) if lengths else 1.0
