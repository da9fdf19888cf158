"""Axis, centre and angle of a hinge between two IMUs, estimated from their motion [1]_ [2]_.

Every point on the axis has one acceleration. Both segments share every component of angular velocity but the one about
the axis. First, both facts are used through norms, which need no common frame. This estimate then starts one
least-squares fit of all quantities, in which the angle is the integral of the measured angular rates.

.. [1] T. Seel, T. Schauer, J. Raisch, Joint axis and position estimation from inertial measurement data by exploiting
   kinematic constraints, IEEE CCA, 2012.
.. [2] T. Seel, J. Raisch, T. Schauer, IMU-based joint angle measurement for gait analysis, Sensors 14(4), 2014.

The angle follows by a Kalman filter over gyroscopes and the directions that both sensors see; `fit_hinge` does both on
arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from ..._errors import RecordingError
from ..._tabular import data_frame
from ...numerics.arguments import with_checked_arguments
from ...numerics.filters import runs
from ...numerics.sampled import sampled
from ...numerics.uncertainty import correlation_length
from .imu_angle import Inertial


@dataclass(frozen=True)
class HingeThresholds:
    """Thresholds and prior spreads of the search for a hinge's axis and centre."""

    min_hinge_rate: float = 0.2  # a hinge can be found only if it turns at least this fast, RMS [rad/s]
    min_rest_s: float = 0.5  # a gyroscope's offset is estimated where the sensor rests for at least this time
    rest_spread: float = 0.03  # largest standard deviation of the rates of a sensor at rest [rad/s]
    offset_spread: float = 0.01  # prior standard deviation of a MEMS gyroscope's remaining offset [rad/s]
    arm_spread: float = 1.0  # prior standard deviation of a sensor's distance from the joint [m]
    sign_ratio: float = 2.0  # the wrong direction of an axis must have a sum of squares larger by at least this factor
    # Noise of acceleration [m/s^2] and rate [rad/s] that the first of two passes assumes.
    start_noise: tuple[float, ...] = (0.3, 0.03)


HINGE_THRESHOLDS = HingeThresholds()


@dataclass(frozen=True, eq=False)
class Hinge:
    """Where a hinge is, as two sensors see it; first the proximal one."""

    # (2, 3) Unit vectors along the hinge, in each sensor's frame, of one sense: the angle grows as the distal segment
    # turns about it against the proximal one
    axes: np.ndarray
    # (2, 3) From the hinge's centre to each sensor, in its frame [m]. Any point of the axis would do; this one is as
    # far along it from one sensor as from the other
    arms: np.ndarray
    offsets: np.ndarray  # (2, 3) What the gyroscopes read at rest [rad/s]; zero where they never rested
    drift: float  # What the offsets leave of the rate about the hinge [rad/s]
    rested: bool  # Whether a rest was found
    noise: tuple[float, float]  # RMS misfit of joint accelerations [m/s^2] and of rates across the hinge [rad/s]
    memory: tuple[float, float]  # How many samples share one independent misfit, of each
    # (11,) Of two tilts of each axis [rad], both arms [m] and the drift [rad/s]; coloured misfit allowed for
    standard_errors: np.ndarray
    sign_ratio: float  # How much worse the other sense of the distal axis fits
    seconds: float  # How long the motion was [s]


def find_hinge(proximal: Inertial, distal: Inertial) -> Hinge:
    """Axes, centre and gyroscope offsets of a hinge."""
    if len(proximal) != len(distal):
        raise RecordingError(
            f"hinge: found {len(proximal)} and {len(distal)} samples, expected equal numbers from both IMUs"
        )
    found = [_rest_offset(imu) for imu in (proximal, distal)]
    offsets = np.array([np.zeros(3) if each is None else each for each in found])
    rates = [imu.angular_velocity - offset for imu, offset in zip((proximal, distal), offsets, strict=True)]
    axes = hinge_axes(*rates)
    speed = min(float(np.sqrt(np.mean((rates[1] @ (s * axes[1]) - rates[0] @ axes[0]) ** 2))) for s in (1.0, -1.0))
    if speed < HINGE_THRESHOLDS.min_hinge_rate:
        raise RecordingError(
            f"hinge: the joint turns at {np.degrees(speed):.2g} deg/s RMS in the "
            f"{proximal.period * len(proximal):.3g} s given, expected at least "
            f"{np.degrees(HINGE_THRESHOLDS.min_hinge_rate):.2g} deg/s to find axis and centre: move faster"
        )
    motions = [_Motion.of(imu, offset) for imu, offset in zip((proximal, distal), offsets, strict=True)]
    arms = hinge_arms(motions[0], motions[1], axes)
    fits = sorted((_fit(motions, axes * [[1.0], [sense]], arms) for sense in (1.0, -1.0)), key=lambda fit: fit[0])
    (_, best, model), ratio = fits[0], fits[1][0] / max(fits[0][0], 1e-12)
    if ratio < HINGE_THRESHOLDS.sign_ratio:
        raise RecordingError(
            "hinge: both senses of the distal axis fit the motion about equally "
            f"(ratio of squares {ratio:.2g}, expected {HINGE_THRESHOLDS.sign_ratio:g} or more): "
            "move the whole limb about other axes too"
        )
    found_axes, found_arms, _, drift = model.unpack(best.x)
    acceleration, rate = model.misfits(best.x)
    shared = (correlation_length(acceleration), correlation_length(rate))
    covariance = np.linalg.inv(best.jac.T @ best.jac) * max(shared)
    return Hinge(
        axes=found_axes,
        arms=_centred(found_axes, found_arms),
        offsets=offsets,
        drift=float(drift),
        rested=all(each is not None for each in found),
        noise=(_rms(acceleration), _rms(rate)),
        memory=shared,
        standard_errors=np.sqrt(np.diag(covariance))[[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11]],
        sign_ratio=float(ratio),
        seconds=float(proximal.period * len(proximal)),
    )


def hinge_axes(proximal: np.ndarray, distal: np.ndarray) -> np.ndarray:
    """The directions about which two rigid segments may turn differently: |w1 x j1| = |w2 x j2|, by Gauss-Newton.
    `proximal`, `distal` (n, 3) [rad/s]; gives (2, 3)."""

    def misfit(angles):
        j1, j2 = _unit(angles[:2]), _unit(angles[2:])
        across = (np.linalg.norm(np.cross(w, j), axis=1) for w, j in ((proximal, j1), (distal, j2)))
        return np.subtract(*across)

    # Six starts spread over the sphere: the misfit has other minima, and is the same for both senses.
    starts = [
        (a, b, c, d) for a, b in ((0.1, 0.1), (0.1, 1.6), (1.4, 0.1)) for c, d in ((0.1, 0.1), (0.1, 1.6), (1.4, 0.1))
    ]
    best = min((least_squares(misfit, start) for start in starts), key=lambda fit: fit.cost)
    return np.stack([_unit(best.x[:2]), _unit(best.x[2:])])


def hinge_arms(proximal: _Motion, distal: _Motion, axes: np.ndarray) -> np.ndarray:
    """From the hinge's centre to each sensor: the centre's acceleration has one length, whichever sensor it is
    carried from. `axes` (2, 3); gives (2, 3) [m]."""

    def misfit(arms):
        first, second = proximal.joint_acceleration(arms[:3]), distal.joint_acceleration(arms[3:])
        return np.linalg.norm(first, axis=1) - np.linalg.norm(second, axis=1)

    return _centred(axes, least_squares(misfit, np.full(6, 0.01)).x.reshape(2, 3))


def across(axis: np.ndarray) -> np.ndarray:
    """Two unit vectors, shape (2, 3), that make a right-handed frame with `axis`, shape (3,), as its third."""
    far = np.eye(3)[np.argmin(np.abs(axis))]
    first = far - axis * (axis @ far)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])


def lever(rate: np.ndarray, change: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Acceleration of a point against another of the same body: w x (w x r) + dw/dt x r, shape (n, 3) [m/s^2].

    `rate` [rad/s] and `change` [rad/s^2] have shape (n, 3), `arm` [m] has shape (3,).
    """
    return np.cross(rate, np.cross(rate, arm)) + np.cross(change, arm)


@dataclass(frozen=True, eq=False)
class _Motion:
    """One sensor: rates less offset, their derivative and integral by cubic splines, accelerations."""

    time: np.ndarray
    rate: np.ndarray
    change: np.ndarray
    turned: np.ndarray
    acceleration: np.ndarray

    @classmethod
    def of(cls, imu: Inertial, offset: np.ndarray) -> _Motion:
        time = imu.time - imu.time[0]
        spline = CubicSpline(time, imu.angular_velocity - offset)
        return cls(time, spline(time), spline(time, 1), spline.antiderivative()(time), imu.acceleration)

    def joint_acceleration(self, arm: np.ndarray) -> np.ndarray:
        return self.acceleration - lever(self.rate, self.change, arm)


@dataclass(frozen=True, eq=False)
class _Model:
    """Misfit of a hinge to both motions. Unknown are tilts of the axes, the arms, the first angle and the drift."""

    motions: list[_Motion]
    axes: np.ndarray

    def unpack(self, x):
        tilted = np.stack([j + tilt @ across(j) for j, tilt in zip(self.axes, (x[:2], x[2:4]), strict=True)])
        return tilted / np.linalg.norm(tilted, axis=1, keepdims=True), x[4:10].reshape(2, 3), x[10], x[11]

    def misfits(self, x):
        """Return the misfits of the joint's acceleration, (n, 3) [m/s^2], and of the rates across the hinge, (n, 2)
        [rad/s]."""
        axes, arms, start, drift = self.unpack(x)
        first, second = self.motions
        angle = start + second.turned @ axes[1] - first.turned @ axes[0] - drift * first.time
        forces = [m.joint_acceleration(r) for m, r in zip(self.motions, arms, strict=True)]
        frames = [across(j) for j in axes]
        flat = [f @ frame.T for f, frame in zip(forces, frames, strict=True)]
        along = forces[0] @ axes[0] - forces[1] @ axes[1]
        turning = [m.rate @ frame.T for m, frame in zip(self.motions, frames, strict=True)]
        acceleration = np.column_stack([flat[0] - turned(flat[1], angle), along])
        return acceleration, turning[0] - turned(turning[1], angle)


def turned(flat: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Plane vectors, shape (n, 2), turned by angles, shape (n,) [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * flat[:, 0] - sin * flat[:, 1], sin * flat[:, 0] + cos * flat[:, 1]], axis=-1)


def _fit(motions: list[_Motion], axes: np.ndarray, arms: np.ndarray):
    model = _Model(motions, axes)
    start = np.concatenate([np.zeros(4), arms.ravel(), [_first_angle(motions, axes, arms), 0.0]])
    # The senses are compared by the first pass, whose weights are the same for both.
    first = _weighed(model, start, HINGE_THRESHOLDS.start_noise)
    acceleration, turning = model.misfits(first.x)
    noise = (max(_rms(acceleration), 1e-9), max(_rms(turning), 1e-9))
    return first.cost, _weighed(model, first.x, noise), model


def _weighed(model: _Model, start: np.ndarray, noise: tuple[float, float]):
    def misfit(x):
        acceleration, rate = model.misfits(x)
        priors = [x[4:10] / HINGE_THRESHOLDS.arm_spread, [x[11] / HINGE_THRESHOLDS.offset_spread]]
        return np.concatenate([acceleration.ravel() / noise[0], rate.ravel() / noise[1], *priors])

    return least_squares(misfit, start, x_scale="jac")


def _first_angle(motions: list[_Motion], axes: np.ndarray, arms: np.ndarray) -> float:
    first, second = (m.joint_acceleration(r) @ across(j).T for m, r, j in zip(motions, arms, axes, strict=True))
    change = motions[1].turned @ axes[1] - motions[0].turned @ axes[0]
    second = turned(second, change)
    across_both = np.sum(second[:, 0] * first[:, 1] - second[:, 1] * first[:, 0])
    return float(np.arctan2(across_both, np.sum(second * first)))


def _rest_offset(imu: Inertial) -> np.ndarray | None:
    """Mean rate over the first stretch in which the sensor rests; None where it never does."""
    length = max(round(HINGE_THRESHOLDS.min_rest_s / imu.period), 3)
    rate = imu.angular_velocity
    if len(rate) < length:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(rate, length, axis=0)
    quiet = np.sqrt(np.sum(np.var(windows, axis=-1), axis=-1)) < HINGE_THRESHOLDS.rest_spread
    # A slow steady turn is quiet too; an offset is small.
    quiet &= np.linalg.norm(windows.mean(axis=-1), axis=-1) < 5.0 * HINGE_THRESHOLDS.rest_spread
    if not quiet.any():
        return None
    run = max(runs(quiet), key=lambda each: each.stop - each.start)
    return rate[run.start : run.stop + length - 1].mean(axis=0)


def _centred(axes: np.ndarray, arms: np.ndarray) -> np.ndarray:
    along = 0.5 * float(np.sum(arms * axes))
    return arms - along * axes


def _unit(angles: np.ndarray) -> np.ndarray:
    cos = np.cos(angles[0])
    return np.array([cos * np.cos(angles[1]), cos * np.sin(angles[1]), np.sin(angles[0])])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@dataclass(frozen=True)
class AngleNoise:
    """Noise that the filter of a hinge's angle assumes."""

    gyroscope_gain: float = 0.005  # share of a turn that a MEMS gyroscope's gain may miss
    drift_walk: float = 1e-4  # what its offset wanders in a second [rad/s/sqrt(s)]
    start_drift: float = 0.003  # spread of the drift at first [rad/s]
    least_known: float = 1.0  # a direction that tells the angle no better than this is not used [rad^2]


ANGLE_NOISE = AngleNoise()


@dataclass(frozen=True, eq=False)
class HingeAngle:
    """A hinge's angle at every sample."""

    time: np.ndarray  # (n,) [s]
    angle: np.ndarray  # (n,) Unwrapped [rad]; its zero is that of the two frames of `Hinge.axes`, an arbitrary one
    standard_error: np.ndarray  # (n,) [rad], by the filter's own account
    drift: np.ndarray  # (n,) Gyroscope offset about the hinge, less those already taken off [rad/s]
    offline: bool  # Whether later samples were used


def hinge_angle(
    proximal: Inertial, distal: Inertial, hinge: Hinge, *, offline: bool = True, directions: bool = True
) -> HingeAngle:
    """Follow a hinge's angle."""
    if len(proximal) != len(distal):
        raise RecordingError(
            f"hinge: found {len(proximal)} and {len(distal)} samples, expected equal numbers from both IMUs"
        )
    time, period = proximal.time, proximal.period
    frames = [across(axis) for axis in hinge.axes]
    rates = [imu.angular_velocity - o for imu, o in zip((proximal, distal), hinge.offsets, strict=True)]
    steps = np.diff(_turned(time, rates[1] @ hinge.axes[1] - rates[0] @ hinge.axes[0], offline), prepend=0.0)
    forces = [
        (imu.acceleration - lever(rate, _change(time, rate, offline), arm)) @ frame.T
        for imu, rate, arm, frame in zip((proximal, distal), rates, hinge.arms, frames, strict=True)
    ]
    turning = [rate @ frame.T for rate, frame in zip(rates, frames, strict=True)]
    seen = [
        _direction(first, second, noise**2 * memory)
        for (first, second), noise, memory in zip((forces, turning), hinge.noise, hinge.memory, strict=True)
    ]
    start = next((i for i in range(len(time)) if seen[0][1][i] < ANGLE_NOISE.least_known), None)
    if start is None:
        raise RecordingError(
            "hinge: the joint centre accelerates only along the hinge axis, so that no angle can be found: move the "
            "joint across its axis too"
        )
    first = (seen[0][0][start] - steps[1 : start + 1].sum(), seen[0][1][start])
    filtered = _Filter(period, steps, seen if directions else [], first, hinge)
    return filtered.smoothed(time) if offline else filtered.causal(time)


def _turned(time: np.ndarray, rate: np.ndarray, offline: bool) -> np.ndarray:
    if offline:
        return CubicSpline(time, rate).antiderivative()(time)
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))))


def _change(time: np.ndarray, rate: np.ndarray, offline: bool) -> np.ndarray:
    if offline:
        return CubicSpline(time, rate)(time, 1)
    # Backwards, exact for parabolas: no later sample, and no delay of half a period either.
    change = np.zeros_like(rate)
    step = (time[-1] - time[0]) / (len(time) - 1)
    change[2:] = (3.0 * rate[2:] - 4.0 * rate[1:-1] + rate[:-2]) / (2.0 * step)
    return change


def _direction(first: np.ndarray, second: np.ndarray, variance: float) -> tuple[np.ndarray, np.ndarray]:
    """Angle from the second plane vector to the first, and its variance: small for long vectors."""
    angle = np.arctan2(second[:, 0] * first[:, 1] - second[:, 1] * first[:, 0], np.sum(first * second, axis=1))
    squares = [np.maximum(np.sum(v**2, axis=1), 1e-12) for v in (first, second)]
    return angle, variance * (1.0 / squares[0] + 1.0 / squares[1])


class _Filter:
    """The Kalman filter's run over a recording: predicted and corrected states and covariances."""

    def __init__(self, period, steps, seen, first, hinge):
        n = len(steps)
        self.transition = np.array([[1.0, -period], [0.0, 1.0]])
        self.predicted, self.spread_predicted = np.empty((n, 2)), np.empty((n, 2, 2))
        self.state, self.spread = np.empty((n, 2)), np.empty((n, 2, 2))
        white = (hinge.noise[1] * period) ** 2
        x, p = np.array([first[0], hinge.drift]), np.diag([first[1], ANGLE_NOISE.start_drift**2])
        for i in range(n):
            if i:
                x = self.transition @ x
                x[0] += steps[i]
                p = self.transition @ p @ self.transition.T
                p[0, 0] += white + (ANGLE_NOISE.gyroscope_gain * steps[i]) ** 2
                p[1, 1] += ANGLE_NOISE.drift_walk**2 * period
            self.predicted[i], self.spread_predicted[i] = x, p
            for angle, variance in seen:
                if variance[i] < ANGLE_NOISE.least_known:
                    miss = (angle[i] - x[0] + np.pi) % (2.0 * np.pi) - np.pi
                    gain = p[:, 0] / (p[0, 0] + variance[i])
                    x, p = x + gain * miss, p - np.outer(gain, p[0])
            self.state[i], self.spread[i] = x, p

    def causal(self, time: np.ndarray) -> HingeAngle:
        return HingeAngle(time, self.state[:, 0], np.sqrt(self.spread[:, 0, 0]), self.state[:, 1], False)

    def smoothed(self, time: np.ndarray) -> HingeAngle:
        state, spread = self.state.copy(), self.spread.copy()
        for i in range(len(state) - 2, -1, -1):
            gain = self.spread[i] @ self.transition.T @ np.linalg.inv(self.spread_predicted[i + 1])
            state[i] += gain @ (state[i + 1] - self.predicted[i + 1])
            spread[i] += gain @ (spread[i + 1] - self.spread_predicted[i + 1]) @ gain.T
        return HingeAngle(time, state[:, 0], np.sqrt(spread[:, 0, 0]), state[:, 1], True)


DEFAULT_CALIBRATION_S = 20.0
"""Axis and centre are found in this first part of the recording by default."""


@dataclass(frozen=True, eq=False)
class HingeFit:
    """A hinge between two IMUs and its angle.

    Attributes
    ----------
    hinge : Hinge
        Axes, centre and gyroscope offsets, in each sensor's frame.
    angle : HingeAngle
        ``time`` [s], ``angle`` [rad] and ``standard_error`` [rad], each of shape (n,).
    """

    hinge: Hinge = field(repr=False)
    angle: HingeAngle = field(repr=False)

    def to_frame(self):
        """Return time, angle and its standard error as a data frame; needs pandas."""
        found = self.angle
        return data_frame({"time": found.time, "angle": found.angle, "standard_error": found.standard_error})


@with_checked_arguments
def fit_hinge(
    time: ArrayLike,
    proximal: tuple[ArrayLike, ArrayLike],
    distal: tuple[ArrayLike, ArrayLike],
    *,
    calibration: float = DEFAULT_CALIBRATION_S,
    causal: bool = False,
) -> HingeFit:
    """Find the axis of a hinge joint from two IMUs, and follow its angle without drift.

    Neither magnetometers nor a known mounting are needed. The joint has to move in the calibration.

    Parameters
    ----------
    time : array_like, shape (n,)
        Evenly sampled, common to both IMUs [s].
    proximal, distal : tuple of array_like, each of shape (n, 3)
        Angular velocity [rad/s] and specific force [m/s^2] of the IMU on either segment, each in its own frame.
    calibration : float
        Length of the first part of the recording in which axis and centre are found [s].
    causal : bool
        Whether the angle uses past samples only, as in real time.

    Returns
    -------
    HingeFit
        ``.angle.angle``, shape (n,) [rad], its ``standard_error``, and ``.hinge`` with the axes.

    Raises
    ------
    RecordingError
        If arrays do not fit together, time is uneven, or the joint hardly moves in the calibration.

    Examples
    --------
    With recordings of two IMUs on thigh and shank:

    >>> fit = pl.fit_hinge(t, (thigh_rate, thigh_force), (shank_rate, shank_force))    # doctest: +SKIP
    >>> fit.angle.angle                                                            # doctest: +SKIP
    """
    (t,) = sampled("fit_hinge", time, least=3)
    if not calibration > 0.0:
        raise RecordingError(f"fit_hinge: calibration: found {calibration:g} s, expected a time above 0")
    first, second = _inertial(t, *proximal, "proximal"), _inertial(t, *distal, "distal")
    end = t[0] + calibration
    hinge = find_hinge(first.between(t[0], end), second.between(t[0], end))
    return HingeFit(hinge, hinge_angle(first, second, hinge, offline=not causal))


def _inertial(time: np.ndarray, rate: ArrayLike, force: ArrayLike, where: str) -> Inertial:
    found = [np.asarray(rate, float), np.asarray(force, float)]
    for name, values in zip(("angular velocity", "specific force"), found, strict=True):
        if values.shape != (len(time), 3):
            raise RecordingError(f"fit_hinge, {where} {name}: found shape {values.shape}, expected ({len(time)}, 3)")
        if not np.isfinite(values).all():
            raise RecordingError(f"fit_hinge, {where} {name}: found missing samples (NaN), expected none")
    return Inertial(time, *found)
