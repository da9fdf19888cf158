"""Joint simulated without Pellucid: a plain integrator with its own friction model.

The plant is one rigid body on an axis under gravity, integrated by Runge and Kutta's fourth-order method between the
samples of a controller at 500 Hz. Friction is tanh-regularised dry friction and viscous friction, or a LuGre bristle
[1]_; a payload may be attached. Encoder and torque sensor have noise. Pellucid's friction terms, plants and filters are
not used.

.. [1] C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of systems with friction",
   IEEE Trans. Automatic Control 40, 1995.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pellucid.study.procedures.registry import open_study
from pellucid.study.study import Study

RATE_HZ = 500.0
"""Rate of the controller and of the recordings."""

SUBSTEPS = 10
"""Steps of the integrator in each period of the controller."""

STICKING_SPEED = 5e-3
"""Speed over which dry friction changes its sign [rad/s]."""

GRAVITY = 9.80665
"""Standard gravity [m/s^2]."""

STUDY_HEAD = """
name = "foreign"
[rig]
joint = "joint"
motion = "rotary"
lifts = "flexion"
[rig.drive]
kind = "torque"
[channels]
time = { column = "time", unit = "s" }
position = { column = "position", unit = "rad" }
torque = { column = "torque", unit = "N*m" }
[processing]
lowpass = "15 Hz"
decimate = 10
trim = 100
dead_band = "0.05 rad/s"
"""


@dataclass(frozen=True)
class ForeignJoint:
    """Constants of a simulated joint, SI."""

    inertia: float
    gravity: float
    viscous: float
    coulomb: float
    bristle: float = 0.0  # stiffness of the LuGre bristle [N*m/rad]; 0: dry friction alone
    load: float = 0.0  # share of the load that friction takes
    position_noise: float = 2e-5  # of the encoder [rad]
    torque_noise: float = 0.01  # as a share of gravity or dry friction

    def with_payload(self, mass: float, distance: float) -> ForeignJoint:
        """Return the joint with a point mass [kg] at a distance [m]."""
        return replace(
            self,
            inertia=self.inertia + mass * distance**2,
            gravity=self.gravity + mass * GRAVITY * distance,
        )


def drawn_joint(rng: np.random.Generator, **more: float) -> ForeignJoint:
    """Return a joint with constants drawn over the sizes of wearable robots' joints."""
    gravity = float(np.exp(rng.uniform(np.log(1.0), np.log(20.0))))
    return ForeignJoint(
        inertia=gravity / GRAVITY * float(rng.uniform(0.1, 0.4)),
        gravity=gravity,
        viscous=gravity * float(rng.uniform(0.02, 0.15)),
        coulomb=gravity * float(rng.uniform(0.03, 0.3)),
        **more,
    )


def drawn_sines(rng: np.random.Generator, count: int, rate: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frequency [Hz], phase and amplitude [rad] of six sines of each reference, each (6, count)."""
    frequency, phase = rate * rng.uniform(0.08, 1.3, (6, count)), rng.uniform(0.0, 2.0 * np.pi, (6, count))
    size = rng.uniform(0.4, 1.0, (6, count)) / np.sqrt(1.0 + (frequency / 0.4) ** 2)
    return frequency, phase, size * (1.2 / size.sum(axis=0))


def recorded(
    joints: Sequence[ForeignJoint], rng: np.random.Generator, seconds: float = 30.0, rate: float = 1.0
) -> list[np.ndarray]:
    """Return time, position and torque, (n, 3), of joints that follow sines under a PD loop with stiff gains.

    All joints are integrated side by side. `rate` multiplies the frequencies of the sines.
    """
    n, step, count = round(seconds * RATE_HZ), 1.0 / RATE_HZ, len(joints)
    time = np.arange(n) * step
    frequency, phase, size = drawn_sines(rng, count, rate)
    names = ("inertia", "gravity", "viscous", "coulomb", "bristle", "load", "position_noise", "torque_noise")
    made = {name: np.array([getattr(joint, name) for joint in joints]) for name in names}
    inertia, gravity, viscous = made["inertia"], made["gravity"], made["viscous"]
    bristle, bending = made["bristle"], made["bristle"] > 0.0
    damping = 0.1 * np.sqrt(bristle * inertia)
    omega = 2.0 * np.pi * 6.0
    kp, kd = inertia * omega**2 + gravity, 1.4 * inertia * omega

    def slope(x: np.ndarray, torque: np.ndarray) -> np.ndarray:
        q, v, z = x
        level = made["coulomb"] + made["load"] * np.abs(torque)
        rate_of_bristle = np.where(bending, v - bristle * np.abs(v) / level * z, 0.0)
        friction = np.where(bending, bristle * z + damping * rate_of_bristle, level * np.tanh(v / STICKING_SPEED))
        return np.array([v, (torque - friction - viscous * v - gravity * np.sin(q)) / inertia, rate_of_bristle])

    turning = 2.0 * np.pi * frequency
    x, rows = np.zeros((3, count)), np.empty((n, 2, count))
    x[0], x[1] = np.sum(size * np.sin(phase), axis=0), np.sum(size * turning * np.cos(phase), axis=0)
    h = step / SUBSTEPS
    for i in range(n):
        angle = turning * time[i] + phase
        reference, speed = np.sum(size * np.sin(angle), axis=0), np.sum(size * turning * np.cos(angle), axis=0)
        torque = kp * (reference - x[0]) + kd * (speed - x[1]) + gravity * np.sin(reference)
        rows[i] = x[0], torque
        for _ in range(SUBSTEPS):
            a = slope(x, torque)
            b = slope(x + 0.5 * h * a, torque)
            c = slope(x + 0.5 * h * b, torque)
            x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(x + h * c, torque))
    # A torque acts from its sample to the next. What is recorded at a sample is the mean of what acted around it.
    rows[1:, 1] = 0.5 * (rows[1:, 1] + rows[:-1, 1])
    noise = made["torque_noise"] * np.maximum(made["coulomb"], 0.1 * gravity)
    rows[:, 0] += made["position_noise"] * rng.standard_normal((n, count))
    rows[:, 1] += noise * rng.standard_normal((n, count))
    return [np.column_stack([time, rows[:, :, k]]) for k in range(count)]


def written(folder: Path, recordings: dict[str, tuple[str, np.ndarray]], more: str = "") -> Study:
    """Write recordings, each a use (with further keys of its entry after a line break) and a table, as a study."""
    folder.mkdir(parents=True, exist_ok=True)
    text = STUDY_HEAD + more
    for name, (use, table) in recordings.items():
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="time,position,torque", comments="", fmt="%.9g")
        first, _, rest = use.partition("\n")
        text += f'[[recordings]]\nname = "{name}"\nfile = "{name}.csv"\nuse = "{first}"\n{rest}\n'
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return open_study(folder)
