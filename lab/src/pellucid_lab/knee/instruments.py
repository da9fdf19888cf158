"""What the virtual orthosis's and its wearer's instruments write: encoders, the IMU on the ankle, the EMG amplifier.

The IMU sits off the joint's axis, askew, on its own clock. It feels gravity and the arc it moves along, and sees the
earth's field with whatever steel and currents add to it. Its segment's frame is along the segment, towards flexion, and
along the axis; a thigh that is believed to stand still sways, which only the IMU notices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellucid.models.joint import GRAVITY

from ..noise import draw_noise
from .machine import KneeMachine
from .subject import KneeSubject


@dataclass(frozen=True)
class ImuReadings:
    """What the IMU wrote."""

    time: np.ndarray  # (k,) On its own clock [s]
    acceleration: np.ndarray  # acceleration, angular_velocity: (k, 3) [m/s^2], gravity's reaction included; [rad/s]
    angular_velocity: np.ndarray
    magnetic_field: np.ndarray | None  # (k, 3) [T]; None for a six-axis chip
    clock_offset: float  # The actuator's time at its time 0 [s]: the truth
    angle: np.ndarray  # (k,) Of the joint at its samples [rad]: the truth


@dataclass(frozen=True)
class Mounting:
    """How the instruments sit, and are off, while one subject has them on."""

    remounting: np.ndarray  # (3,) Rotation vector between the IMU's place on the orthosis and on the ankle [rad]
    accelerometer_bias: np.ndarray  # accelerometer_bias, gyroscope_bias, magnetometer_bias: (3,) [m/s^2], [rad/s], [T]
    gyroscope_bias: np.ndarray
    magnetometer_bias: np.ndarray
    # Factors on the subject's EMG gains of rectus femoris and lateral hamstring [1]
    emg_gain: tuple[float, float]


def draw_mounting(rig: KneeMachine, rng: np.random.Generator) -> Mounting:
    """How the instruments sit this time."""
    imu = rig.constants.imu
    return Mounting(
        imu.remounting * rng.standard_normal(3),
        imu.accelerometer_bias * rng.standard_normal(3),
        imu.gyroscope_bias * rng.standard_normal(3),
        imu.magnetometer_bias * rng.standard_normal(3),
        tuple(np.exp(rig.constants.emg.gain_spread * rng.standard_normal(2)).tolist()),
    )


def rotation(vector: np.ndarray) -> np.ndarray:
    """Rotation matrix of a rotation vector [rad], shape (3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(np.asarray(vector, float)).as_matrix()


def segment_senses(
    rig: KneeMachine, lever: tuple[float, float], angle: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""What an ideal nine-axis sensor at a place on a turning segment senses, in the segment's frame.

    At :math:`r = (l, c)` along and across, with :math:`g` down: along
    :math:`-l \dot q^2 - c \ddot q - g \cos q`, across :math:`l \ddot q - c \dot q^2 + g \sin q`.

    `lever` [m]; `angle`, `velocity`, `acceleration` (k,) [rad], [rad/s], [rad/s^2]; gives `acceleration`,
    `angular_velocity`, `magnetic_field` (k, 3) [m/s^2], [rad/s], [T].
    """
    imu, zero = rig.constants.imu, np.zeros_like(angle)
    along, across = lever
    cos, sin = np.cos(angle), np.sin(angle)
    force = np.column_stack([
        -along * velocity**2 - across * acceleration - GRAVITY * cos,
        along * acceleration - across * velocity**2 + GRAVITY * sin,
        zero,
    ])  # fmt: skip
    # Flexion swings the heel towards `heading` from magnetic north; the field dips below the horizon.
    down = imu.field * np.sin(imu.dip)
    heel = imu.field * np.cos(imu.dip) * np.cos(imu.heading)
    axis = imu.field * np.cos(imu.dip) * np.sin(imu.heading)
    field = np.column_stack([cos * down + sin * heel, cos * heel - sin * down, zero + axis])
    return force, np.column_stack([zero, zero, velocity]), field


def take_imu(
    rig: KneeMachine,
    subject: KneeSubject | None,
    angle: np.ndarray,
    velocity: np.ndarray,
    mounting: Mounting,
    rng: np.random.Generator,
    *,
    dropout: tuple[float, float] | None = None,
) -> ImuReadings:
    """What the IMU writes while its segment moves, shape (n,) [rad], [rad/s], on a subject's ankle or, with nobody, on
    the orthosis; a dropout is when it falls silent and for how long [s]."""
    from scipy.interpolate import CubicSpline
    from scipy.ndimage import gaussian_filter1d

    imu, fs, n = rig.constants.imu, rig.constants.encoders.rate, len(angle)
    offset = imu.clock_offset + imu.clock_offset_spread * rng.standard_normal()
    k = int(((n - 1) / fs - max(offset, 0.0)) * imu.rate) - 1
    own = np.arange(k) / imu.rate + imu.jitter * rng.standard_normal(k)
    own -= own[0]
    at = offset + own * (1.0 + imu.clock_drift)
    sway = np.zeros(n)
    if subject is not None:
        sway = draw_noise((n,), imu.sway, imu.sway_memory, fs, rng)
        sway = gaussian_filter1d(sway, 0.1 * fs)  # a body does not sway faster
    grid = np.arange(n) / fs
    # Velocity is the plant's own; a spline through it gives the acceleration between periods.
    rate = CubicSpline(grid, velocity + np.gradient(sway, 1.0 / fs))
    leaning = np.interp(at, grid, angle + sway)
    lever = imu.orthosis_lever
    if subject is not None:
        lever = (imu.lever[0] * subject.shank_length, imu.lever[1])
    ideal = segment_senses(rig, tuple(lever), leaning, rate(at), rate(at, 1))
    turn = rotation(imu.mounting)
    if subject is not None:
        turn = rotation(mounting.remounting) @ turn
    wandering = draw_noise((3, k), imu.gyroscope_drift, imu.gyroscope_memory, imu.rate, rng).T
    steel = draw_noise((3, k), imu.disturbance, imu.disturbance_memory, imu.rate, rng).T
    biases = (
        mounting.accelerometer_bias,
        mounting.gyroscope_bias + wandering,
        mounting.magnetometer_bias + steel,
    )
    noises = (imu.accelerometer_noise, imu.gyroscope_noise, imu.magnetometer_noise)
    sensed = []
    for true, bias, sd, quantum in zip(ideal, biases, noises, imu.quanta, strict=True):
        value = true @ turn.T + bias + sd * rng.standard_normal((k, 3))
        sensed.append(np.round(value / quantum) * quantum)
    keep = np.ones(k, bool)
    if dropout is not None:
        keep = (at < dropout[0]) | (at >= dropout[0] + dropout[1])
    return ImuReadings(
        np.round(own[keep], 4),
        sensed[0][keep],
        sensed[1][keep],
        sensed[2][keep] if imu.magnetometer else None,
        float(offset),
        np.interp(at, grid, angle)[keep],
    )
