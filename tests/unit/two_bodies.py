"""A limb strapped to an orthosis, in plain NumPy: an independent pair of bodies to hold identifications against.

Many pairs run side by side. The limb is driven by its muscles; the actuator answers with a drag of its own, as a
zero-impedance mode does. Dry friction is smooth or absent: this simulator does not stick.
"""

from dataclasses import dataclass, field

import numpy as np

from pellucid.orthosis.strap.strap_model import Limb, Orthosis, StrappedSwing

FS = 500.0


@dataclass
class Pair:
    """True parameters, SI."""

    orthosis: Orthosis = field(default_factory=lambda: Orthosis(0.048, 0.02, 1.55))
    limb: Limb = field(default_factory=lambda: Limb(0.30, 8.0, 0.2))
    stiffness: float = 20.0
    damping: float = 1.5
    hardening: float = 0.0  # 1/rad^2
    slack: float = 0.0  # the whole gap, rad
    along: float = 0.0  # of the limb's axis, over the cuff's lever
    drag: float = 0.6  # of the actuator, N m s/rad
    dry_drag: float = 1.0  # of the actuator's gear, N m


@dataclass
class Truth:
    """What one pair did: arrays of shape (n,), SI."""

    time: np.ndarray
    position: np.ndarray
    limb: np.ndarray
    position_rates: np.ndarray  # (n, 2): velocity, acceleration
    limb_rates: np.ndarray
    torque: np.ndarray
    knee_torque: np.ndarray

    @property
    def mismatch(self):
        return self.limb - self.position


def swing(pair: Pair, *, seconds=20.0, seed=0, count=1, speeds=(0.6, 0.75, 0.9), substeps=4):
    """`count` trials of free swings at about `speeds` [Hz], after 1 s of rest."""
    rng = np.random.default_rng(seed)
    o, m = pair.orthosis, pair.limb
    n = round(seconds * FS)
    dt = 1.0 / (FS * substeps)
    phase = rng.uniform(0.0, 2.0 * np.pi, (len(speeds), count))
    size = rng.uniform(1.0, 3.0, (len(speeds), count))
    omega = 2.0 * np.pi * np.array(speeds)[:, None] * rng.uniform(0.97, 1.03, (len(speeds), count))

    def muscles(t):
        return min(max(t - 1.0, 0.0), 1.0) * np.sum(size * np.sin(omega * t + phase), axis=0)

    def rates(t, x):
        qe, qk, ve, vk = x
        lever = 1.0 + pair.along * np.cos(qe)
        apart = qk - qe - pair.along * np.sin(qe)
        e = apart - np.clip(apart, -0.5 * pair.slack, 0.5 * pair.slack)
        strap = pair.stiffness * e * (1.0 + pair.hardening * e**2 / 3.0) + pair.damping * (vk - lever * ve)
        if pair.slack:
            strap = np.where(e * strap <= 0.0, 0.0, strap)
        actuator = -pair.drag * ve - pair.dry_drag * np.tanh(ve / 0.1)
        own = o.viscous * ve + o.gravity * np.sin(qe) + o.coulomb * np.tanh(ve / 0.02)
        ae = (actuator + lever * strap - own) / o.inertia
        ak = (muscles(t) - strap - m.viscous * vk - m.gravity * np.sin(qk)) / m.inertia
        return np.array([ve, vk, ae, ak]), actuator

    x = np.zeros((4, count))
    kept = np.empty((n, 7, count))
    for step in range(n):
        t = step / FS
        slope, actuator = rates(t, x)
        kept[step] = [x[0], x[1], x[2], x[3], slope[2], slope[3], actuator]
        for sub in range(substeps):
            at = t + sub * dt
            a, _ = rates(at, x)
            b, _ = rates(at + 0.5 * dt, x + 0.5 * dt * a)
            c, _ = rates(at + 0.5 * dt, x + 0.5 * dt * b)
            d, _ = rates(at + dt, x + dt * c)
            x = x + dt / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    time = np.arange(n) / FS
    drive = np.array([muscles(t) for t in time])
    return [
        Truth(time, kept[:, 0, i], kept[:, 1, i], kept[:, [2, 4], i], kept[:, [3, 5], i], kept[:, 6, i], drive[:, i])
        for i in range(count)
    ]


def record(
    truth: Truth, rng, *, name="swing", split="fitted", noise=0.01, memory=0.7, shift=0.08, offset=0.1, gain=1.0,
    torque_noise=0.05, encoder=2e-4, knee_noise=0.0,
) -> StrappedSwing:  # fmt: skip
    """What instruments saw: the IMU at 20 Hz on its own clock, `shift` behind, with an error that remembers."""
    imu = np.arange(0.013, truth.time[-1], 0.05)
    error = np.empty(len(imu))
    state = rng.standard_normal()
    for i in range(len(imu)):
        state = memory * state + np.sqrt(1.0 - memory**2) * rng.standard_normal()
        error[i] = noise * state
    position = np.round(truth.position / encoder) * encoder if encoder else truth.position
    return StrappedSwing(
        name,
        split,
        truth.time,
        position,
        truth.torque + torque_noise * rng.standard_normal(len(truth.time)),
        imu - shift,
        offset + gain * np.interp(imu, truth.time, truth.limb) + error,
        truth.knee_torque + knee_noise * rng.standard_normal(len(truth.time)),
    )
