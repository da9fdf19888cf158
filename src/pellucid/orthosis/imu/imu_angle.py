"""Angle of a segment from one IMU on it: orientation, the turn about a fixed axis, and its regression to an encoder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..._errors import RecordingError
from ...numerics.clocks import Alignment, align
from ...numerics.filters import zero_phase_lowpass
from ...numerics.resampling import resample
from ...numerics.uncertainty import correlation_length
from .orientation import ORIENTATION_FILTERS, Inertial, conjugate, multiply, orientation, twist

COMMON_BAND_SHARE = 0.4
"""IMU and encoder are compared below this share of the IMU's rate, where both see a motion alike."""


def principal_axis(angular_velocity: np.ndarray) -> tuple[np.ndarray, float]:
    """The direction about which a sensor turns most, and the share of its turning that is about it.
    `angular_velocity` (n, 3) [rad/s]; gives `axis` (3,)."""
    _, size, directions = np.linalg.svd(angular_velocity, full_matrices=False)
    if size[0] == 0.0:
        raise RecordingError("principal axis: found no angular velocity, expected a sensor that turns")
    axis = directions[0]
    return axis * np.sign(axis[np.argmax(np.abs(axis))]), float(size[0] ** 2 / np.sum(size**2))


def segment_angle(quaternions: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Turn about an axis fixed in the sensor, since the first sample.

    A heading that drifts turns the sensor about the vertical. For a level axis that is across the turn looked for, and
    leaves no trace in it.

    `quaternions` (n, 4); `axis` (3,); gives (n,) [rad].
    """
    return twist(multiply(conjugate(quaternions[0]), quaternions), axis)


def euler_angles(quaternions: np.ndarray) -> np.ndarray:
    """Roll, pitch and yaw (about z, then y, then x), shape (n, 3), unwrapped [rad]: what a filter's display shows."""
    turns = Rotation.from_quat(quaternions, scalar_first=True)
    return np.unwrap(turns.as_euler("ZYX")[:, ::-1], axis=0)


@dataclass(frozen=True, eq=False)
class AngleRegression:
    """An encoder's angle as a linear function of what an IMU gives."""

    gains: np.ndarray  # (k,) One for each input [1]
    offset: float  # [rad]
    standard_errors: np.ndarray  # (k + 1,) Of gains and offset; coloured misfit allowed for
    residual: float  # RMS misfit of the samples fitted [rad]

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """The encoder's angle, shape (n,) [rad], from `inputs` of shape (n,) or (n, k)."""
        return np.asarray(inputs, float).reshape(len(inputs), -1) @ self.gains + self.offset


def fit_angle(inputs: np.ndarray, encoder: np.ndarray) -> AngleRegression:
    """Regress an encoder's angle on an IMU's. `inputs` (n,); `encoder` (n,) [rad]."""
    inputs = np.asarray(inputs, float).reshape(len(inputs), -1)
    known = np.isfinite(inputs).all(axis=1) & np.isfinite(encoder)
    columns = np.column_stack([inputs[known], np.ones(int(known.sum()))])
    if len(columns) < 3 * columns.shape[1] or np.linalg.matrix_rank(columns) < columns.shape[1]:
        raise RecordingError(
            f"angle regression: {len(columns)} samples with both instruments do not determine {inputs.shape[1]} gains "
            "and an offset; move the segment through its range"
        )
    solution = np.linalg.lstsq(columns, encoder[known], rcond=None)[0]
    misfit = encoder[known] - columns @ solution
    freedom = len(columns) - columns.shape[1]
    covariance = np.linalg.inv(columns.T @ columns) * (misfit @ misfit) / freedom * correlation_length(misfit)
    return AngleRegression(
        solution[:-1], float(solution[-1]), np.sqrt(np.diag(covariance)), float(np.sqrt(np.mean(misfit**2)))
    )


@dataclass(frozen=True, eq=False)
class FilterError:
    """How one orientation filter's angle compares with an encoder."""

    # method, axes, inputs: ``"vqf"`` or ``"madgwick"``; 6 or 9; what was regressed: ``"axis"`` or ``"outputs"``
    method: str
    axes: int
    inputs: str
    fitted: float  # fitted, heldout: RMS error of the part the regression was fitted to, and of the rest [rad]
    heldout: float
    regression: AngleRegression
    angle: np.ndarray  # (m,) On the encoder's clock; NaN where the IMU does not reach [rad]


def compare_filters(
    imu: Inertial, time: np.ndarray, encoder: np.ndarray, *, fit_until: float, longest_delay: float = 1.0
) -> tuple[Alignment, tuple[FilterError, ...]]:
    """Madgwick and VQF, six axes and, where there is a magnetometer, nine, each by axis and by all outputs. `time`,
    `encoder` (m,) [s], [rad]; `fit_until` [s]; `longest_delay` [s]."""
    early = time < fit_until
    start = imu.between(imu.time[0], fit_until)
    if not early.any() or early.all() or len(start) < 2:
        raise RecordingError(f"compare filters: no encoder or IMU samples before, or none after, {fit_until:g} s")
    axis, _ = principal_axis(start.angular_velocity)
    alignment = align_encoder(start, axis, time[early], encoder[early], longest=longest_delay)
    errors = []
    for method in ORIENTATION_FILTERS:
        for axes in (6, 9) if imu.magnetic_field is not None else (6,):
            turns = orientation(imu, method, axes=axes)
            for inputs, raw in (("axis", segment_angle(turns, axis)), ("outputs", euler_angles(turns))):
                fast = resample(imu.time + alignment.delay, raw, time).samples
                regression = fit_angle(fast[early], encoder[early])
                angle = regression(fast)
                miss = angle - encoder
                fitted, heldout = (float(np.sqrt(np.nanmean(miss[part] ** 2))) for part in (early, ~early))
                errors.append(FilterError(method, axes, inputs, fitted, heldout, regression, angle))
    return alignment, tuple(errors)


def align_encoder(
    imu: Inertial, axis: np.ndarray, time: np.ndarray, encoder: np.ndarray, *, longest: float = 1.0
) -> Alignment:
    """Delay of an encoder's clock against an IMU's, from the rate both see. `axis` (3,); `time`, `encoder` (m,) [s],
    [rad]; `longest` [s]."""
    fs = (len(time) - 1) / float(time[-1] - time[0])
    cutoff = COMMON_BAND_SHARE / imu.period
    rate = np.gradient(encoder, time)
    if cutoff < 0.5 * fs:
        rate = zero_phase_lowpass(rate, cutoff, 4, fs)
    return align(imu.time, imu.angular_velocity @ axis, time, rate, longest=longest)
