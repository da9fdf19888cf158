"""Two IMUs on a hinge that moves in space, by formula: what tests of inertial angles compare with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pellucid.orthosis.imu.imu_angle import Inertial

GRAVITY = np.array([0.0, 0.0, 9.81])
FIELD = np.array([0.0, 20e-6, -44e-6])  # north and down, in the frame x east, y north, z up


@dataclass(frozen=True)
class TwoImus:
    """Both sensors, and the truth behind them."""

    proximal: Inertial
    distal: Inertial
    angle: np.ndarray
    axes: np.ndarray
    arms: np.ndarray


def turned_hinge(rng=None, *, fs=100.0, seconds=30.0, noise=0.0, offset=0.0) -> TwoImus:
    """A hinge whose proximal segment tumbles while it bends; sensors are mounted askew."""
    time = np.arange(round(fs * seconds)) / fs
    ramp = np.clip((time - 1.0) / 2.0, 0.0, 1.0)
    ramp = ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2)
    angle = 0.9 * ramp * np.sin(2.1 * time) + 0.4 * ramp * np.sin(3.7 * time + 0.4) + 0.7
    tilts = [0.5 * ramp * np.sin(1.3 * time), 0.4 * ramp * np.sin(1.9 * time + 1.0), 0.6 * ramp * np.sin(0.8 * time)]
    mounts = Rotation.from_euler("xyz", [[0.2, -0.1, 0.4], [-0.3, 0.25, 2.0]])
    proximal = Rotation.from_euler("xyz", np.stack(tilts, axis=-1))
    hinge_axis = np.array([0.0, 1.0, 0.0])
    distal = proximal * Rotation.from_rotvec(angle[:, None] * hinge_axis)
    centre = np.stack([0.2 * ramp * np.sin(1.7 * time), 0.1 * ramp * np.cos(1.1 * time), 0.05 * ramp], axis=-1)
    arms_body = np.array([[0.02, 0.03, 0.25], [-0.01, 0.02, -0.2]])
    imus = []
    for mount, body, arm in zip(mounts, (proximal, distal), arms_body, strict=True):
        sensor = body * mount
        turning = sensor[:-1].inv() * sensor[1:]
        # Midpoint rates moved to the samples: errors of second order in the period only.
        middle = turning.as_rotvec() * fs
        rate = np.vstack([middle[:1], 0.5 * (middle[1:] + middle[:-1]), middle[-1:]])
        place = centre + body.apply(arm)
        force = sensor.inv().apply(np.gradient(np.gradient(place, 1.0 / fs, axis=0), 1.0 / fs, axis=0) + GRAVITY)
        field = sensor.inv().apply(np.tile(FIELD, (len(time), 1)))
        if noise:
            rate = rate + offset * np.array([1.0, -0.7, 0.4]) + noise * rng.standard_normal(rate.shape)
            force = force + 10.0 * noise * rng.standard_normal(force.shape)
        imus.append(Inertial(time, rate, force, field))
    axes = np.stack([mount.inv().apply(hinge_axis) for mount in mounts])
    arms = np.stack([mount.inv().apply(arm) for mount, arm in zip(mounts, arms_body, strict=True)])
    arms = arms - 0.5 * np.sum(arms * axes) * axes
    return TwoImus(imus[0], imus[1], angle, axes, arms)
