"""Angle of a hinge between two IMUs without drift, causal or over the whole recording.

Gyroscopes carry the angle from sample to sample. Two directions, each seen by both sensors, pull it back: the
acceleration of the hinge's centre, and the part of the angular velocity that is across the hinge. Where such a
direction is along the axis it says nothing, and its weight goes to zero by itself. A Kalman filter has the angle and
what the gyroscopes drift about the hinge as its state; a Rauch-Tung-Striebel pass back over it uses what came later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ..._errors import RecordingError
from .hinge import Hinge, across, lever
from .inertial import Inertial

GYROSCOPE_GAIN = 0.005  # share of a turn that a MEMS gyroscope's gain may miss
DRIFT_WALK = 1e-4  # what its offset wanders in a second [rad/s/sqrt(s)]
START_DRIFT = 0.003  # spread of the drift at first [rad/s]
LEAST_KNOWN = 1.0  # a direction that tells the angle no better than this is not used [rad^2]


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
        raise RecordingError(f"hinge: found {len(proximal)} and {len(distal)} samples, expected as many of both IMUs")
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
    start = next((i for i in range(len(time)) if seen[0][1][i] < LEAST_KNOWN), None)
    if start is None:
        raise RecordingError("hinge: the acceleration of the joint is along its axis throughout: no angle can be found")
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
    angle = np.arctan2(
        second[:, 0] * first[:, 1] - second[:, 1] * first[:, 0],
        np.sum(first * second, axis=1),
    )
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
        x, p = np.array([first[0], hinge.drift]), np.diag([first[1], START_DRIFT**2])
        for i in range(n):
            if i:
                x = self.transition @ x
                x[0] += steps[i]
                p = self.transition @ p @ self.transition.T
                p[0, 0] += white + (GYROSCOPE_GAIN * steps[i]) ** 2
                p[1, 1] += DRIFT_WALK**2 * period
            self.predicted[i], self.spread_predicted[i] = x, p
            for angle, variance in seen:
                if variance[i] < LEAST_KNOWN:
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
