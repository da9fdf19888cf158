"""The limb's angle from an IMU strapped to it, which is first calibrated on the orthosis.

An orientation filter integrates the angular rate by the trapezoidal rule. At 20 Hz this loses half a per cent of a
swing at 0.8 Hz and two per cent of its second harmonic, enough to bias the strap's damping. The joint has one axis, so
the same rates are also integrated along a cubic spline, and the difference is added.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from ...models.parameter import Parameter
from ..imu.imu_angle import FilterError, align_encoder, compare_filters, principal_axis, segment_angle
from ..imu.inertial import Inertial
from ..imu.orientation import orientation
from ..input_output import InputOutput

FITTED_SHARE = 0.6
"""Gain and axis are fitted to this first share of the calibration and evaluated on the rest."""

MAX_CLOCK_DELAY_S = 1.5
"""Largest difference between the clocks of IMU and encoder that is searched [s]."""


@dataclass(frozen=True, eq=False)
class ImuCalibration:
    """Calibration of an IMU that is fixed to the orthosis, against the orthosis's encoder."""

    gain: Parameter  # change of the IMU's angle per change of the encoder's angle [1]
    sd: float  # RMS error of the IMU's angle in the held-out part [rad]
    filters: tuple[FilterError, ...] = field(repr=False)  # errors of all orientation filters, for comparison


def calibrate_imu(imu: Inertial, encoder: InputOutput, *, method: str, axes: int) -> ImuCalibration:
    """Compare an IMU with the encoder of the orthosis that carries it."""
    end = encoder.time[0] + FITTED_SHARE * (encoder.time[-1] - encoder.time[0])
    _, errors = compare_filters(imu, encoder.time, encoder.output, fit_until=end, longest_delay=MAX_CLOCK_DELAY_S)
    chosen = next(e for e in errors if (e.method, e.axes, e.inputs) == (method, axes, "axis"))
    slope, error = abs(float(chosen.regression.gains[0])), float(chosen.regression.standard_errors[0])
    return ImuCalibration(Parameter("gain", "1", 1.0 / slope, error / slope**2), chosen.heldout, errors)


@dataclass(frozen=True, eq=False)
class JointAxis:
    """The joint's axis in the frame of an IMU."""

    axis: np.ndarray  # (3,) unit vector
    sense: float  # 1 if a positive rotation about the axis is positive for the orthosis too, otherwise -1


def find_joint_axis(imu: Inertial, encoder: InputOutput) -> JointAxis:
    """Find the joint's axis in a trial in which the limb moves."""
    axis, _ = principal_axis(imu.angular_velocity - imu.angular_velocity.mean(axis=0))
    found = align_encoder(imu, axis, encoder.time, encoder.output, longest=MAX_CLOCK_DELAY_S)
    return JointAxis(axis, float(np.sign(found.gain)))


def limb_angle_by_imu(imu: Inertial, turning: JointAxis, *, method: str, axes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times and the limb's angle in a trial, each of shape (m,) [s], [rad].

    The angle has the orthosis's sign and is 0 at the first sample.
    """
    rate = imu.angular_velocity @ turning.axis
    between = CubicSpline(imu.time, rate).antiderivative()(imu.time) - cumulative_trapezoid(rate, imu.time, initial=0.0)
    turned = segment_angle(orientation(imu, method, axes=axes), turning.axis)
    # A rotation axis is determined up to its sign, so the spline's correction takes the sign that fits.
    angle = turning.sense * (turned + np.sign(np.sum(np.diff(turned) * rate[1:])) * between)
    for start, stop in imu.gaps:
        angle[(imu.time > start) & (imu.time < stop)] = np.nan
    return imu.time, angle
