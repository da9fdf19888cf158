"""The limb's angle by the IMU strapped to it: calibrated on the orthosis first, then read in every trial.

An orientation filter turns by the mean of two neighbouring rates from sample to sample. At 20 Hz that trapezium loses
half a per cent of a swing at 0.8 Hz and two per cent of its second harmonic, enough to show in the strap's damping. The
joint turns about one axis, so that the same rates can be integrated along a cubic spline, and the difference added.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from ...signals.imu_angle import FilterError, align_encoder, compare_filters, principal_axis, segment_angle
from ...signals.inertial import Inertial
from ...signals.input_output import InputOutput
from ...signals.orientation import orientation
from ..parameter import Parameter

FITTED_SHARE = 0.6
"""First share of the calibration from which gain and axis are found; the rest judges them."""
LONGEST_DELAY = 1.5
"""Between both clocks [s]."""


@dataclass(frozen=True, eq=False)
class ImuCalibration:
    """The IMU against the orthosis's encoder, fixed to the orthosis."""

    gain: Parameter  # Angle by the IMU for each radian of the encoder's [1]
    sd: float  # Error of the IMU's angle in the part that was not fitted [rad]
    filters: tuple[FilterError, ...] = field(repr=False)  # Every orientation filter, for comparison


def calibrate_imu(imu: Inertial, encoder: InputOutput, *, method: str, axes: int) -> ImuCalibration:
    """Compare an IMU with the encoder of the orthosis that carries it."""
    end = encoder.time[0] + FITTED_SHARE * (encoder.time[-1] - encoder.time[0])
    _, errors = compare_filters(imu, encoder.time, encoder.output, fit_until=end, longest_delay=LONGEST_DELAY)
    chosen = next(e for e in errors if (e.method, e.axes, e.inputs) == (method, axes, "axis"))
    slope, error = abs(float(chosen.regression.gains[0])), float(chosen.regression.standard_errors[0])
    return ImuCalibration(Parameter("gain", "1", 1.0 / slope, error / slope**2), chosen.heldout, errors)


@dataclass(frozen=True, eq=False)
class Turning:
    """How the joint's axis lies in an IMU: a unit vector (3,), and whether it turns as the orthosis does, 1 or -1."""

    axis: np.ndarray
    sense: float


def turning_of(imu: Inertial, encoder: InputOutput) -> Turning:
    """The axis, from a trial in which the limb moves."""
    axis, _ = principal_axis(imu.angular_velocity - imu.angular_velocity.mean(axis=0))
    found = align_encoder(imu, axis, encoder.time, encoder.output, longest=LONGEST_DELAY)
    return Turning(axis, float(np.sign(found.gain)))


def limb_by_imu(imu: Inertial, turning: Turning, *, method: str, axes: int) -> tuple[np.ndarray, np.ndarray]:
    """A trial's limb angle, positive as the orthosis's; its zero is that of its first sample. Gives `time`, `angle`
    (m,) [s], [rad]."""
    rate = imu.angular_velocity @ turning.axis
    between = CubicSpline(imu.time, rate).antiderivative()(imu.time) - cumulative_trapezoid(rate, imu.time, initial=0.0)
    turned = segment_angle(orientation(imu, method, axes=axes), turning.axis)
    # A quaternion and its axis may be written either way round.
    angle = turning.sense * (turned + np.sign(np.sum(np.diff(turned) * rate[1:])) * between)
    for start, stop in imu.gaps:
        angle[(imu.time > start) & (imu.time < stop)] = np.nan
    return imu.time, angle
