"""Orientation of one IMU by filters others have written and tested: Madgwick's [1]_ and VQF [2]_, six and nine axes.

.. [1] S. O. H. Madgwick, A. J. L. Harrison, R. Vaidyanathan, Estimation of IMU and MARG orientation using a gradient
   descent algorithm, IEEE ICORR, 2011 (in the revised form of the library imufusion).
.. [2] D. Laidig, T. Seel, VQF: Highly accurate IMU orientation estimation with bias estimation and magnetic
   disturbance rejection, Information Fusion 91, 2023.
"""

from __future__ import annotations

import numpy as np

from ..._errors import RecordingError
from .inertial import Inertial
from .quaternion import continuous

ORIENTATION_FILTERS = ("madgwick", "vqf")
"""Orientation filters that `orientation` offers."""

AXES = (6, 9)
GRAVITY = 9.80665  # [m/s^2] in one g, imufusion's unit of acceleration


def orientation(
    imu: Inertial,
    method: str = "vqf",
    *,
    axes: int = 6,
    offline: bool = True,
    gain: float = 0.5,
) -> np.ndarray:
    """From the sensor's frame to one with z up: x east and y north with nine axes, of free heading with six. `gain`
    [rad/s]; gives (n, 4)."""
    if method not in ORIENTATION_FILTERS or axes not in AXES:
        raise RecordingError(
            f"orientation: found method {method!r} with {axes!r} axes, expected one of "
            f"{', '.join(ORIENTATION_FILTERS)} with 6 or 9"
        )
    if axes == 9 and imu.magnetic_field is None:
        raise RecordingError("orientation: nine axes need a magnetometer, found none; six axes do without")
    used = {"angular velocity": imu.angular_velocity, "acceleration": imu.acceleration}
    if axes == 9 and imu.magnetic_field is not None:
        used["magnetic field"] = imu.magnetic_field
    for name, samples in used.items():
        bad = np.flatnonzero(~np.isfinite(samples).all(axis=1))
        if len(bad):
            raise RecordingError(f"orientation: {name} is not finite at {imu.time[bad[0]]:.3f} s, expected a number")
    found = _vqf(imu, axes, offline) if method == "vqf" else _madgwick(imu, axes, gain)
    return continuous(found / np.linalg.norm(found, axis=1, keepdims=True))


def _vqf(imu: Inertial, axes: int, offline: bool) -> np.ndarray:
    from vqf import VQF, offlineVQF

    gyroscope, accelerometer = (
        np.ascontiguousarray(_since_last(imu.angular_velocity)),
        np.ascontiguousarray(imu.acceleration),
    )
    field = np.ascontiguousarray(imu.magnetic_field) if axes == 9 else None
    if offline:
        out = offlineVQF(gyroscope, accelerometer, field, imu.period)
    else:
        out = VQF(imu.period).updateBatch(gyroscope, accelerometer, field)
    return np.asarray(out[f"quat{axes}D"])


def _madgwick(imu: Inertial, axes: int, gain: float) -> np.ndarray:
    import imufusion

    settings = imufusion.AhrsSettings()
    settings.convention = imufusion.CONVENTION_ENU
    settings.sample_rate = 1.0 / imu.period
    settings.gain = gain
    ahrs = imufusion.Ahrs()
    ahrs.set_settings(settings)
    rates, forces = np.degrees(_since_last(imu.angular_velocity)), imu.acceleration / GRAVITY
    # imufusion is written for microtesla.
    field = 1e6 * imu.magnetic_field if axes == 9 and imu.magnetic_field is not None else None
    out = np.empty((len(imu), 4))
    for i in range(len(imu)):
        if field is not None:
            ahrs.update(rates[i], forces[i], field[i])
        else:
            ahrs.update_no_magnetometer(rates[i], forces[i])
        out[i] = ahrs.get_quaternion()
    return out


def _since_last(rate: np.ndarray) -> np.ndarray:
    """Mean rate since the sample before. Both filters hold a rate over a whole period: the rate at its end would lead
    by half a sample, which at 20 Hz and a quick swing is two degrees."""
    return np.vstack([rate[:1], 0.5 * (rate[1:] + rate[:-1])])
