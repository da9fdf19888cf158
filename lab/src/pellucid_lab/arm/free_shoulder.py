r"""What a shoulder that is not held does to laws of the elbow.

The published laws [1]_ drive the elbow alone. They were identified, and two of them worn, with the shoulder locked by
PI on its position; under the constructor's position control it could not be locked. Here the same two laws, with one
elbow's constants found while the shoulder was held, drive the elbow of the virtual arm while its shoulder is held by
the robot's own loops, or free: then its motors carry its weight and nothing else. A free shoulder that its wearer keeps
still is one thing, a shoulder that its wearer moves another: laws of the elbow alone carry another posture's weight.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
   transparency of a robotic upper limb exoskeleton", Robotica 39, 2021, sections 3.3 and 4.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pellucid.controllers.control_law import DIRECTIONAL_LAW, POSITION_PREDICTION_LAW, ControlLaw, Limits, gate_values

from .human_motion import HumanMotion
from .protocol import gains_of
from .rig import ArmRig
from .wearer import HANDLE_AT, Person
from .worn_trial import WornTrial, motion_of, run

SHOULDER_POSTURE_RAD = (0.12, 0.10, 0.0)
"""Posture of the shoulder, in which the upper arm hangs clear of the trunk [rad]."""

REACH_AMPLITUDES_RAD = (0.63, 0.94, 1.26)
"""Amplitudes of upward and downward movements of the elbow, 36 to 72 degrees [rad]."""

LOWEST_ELBOW_ANGLE_RAD = 0.7
"""Angle of the elbow at which upward movements begin [rad]."""

PEAK_SPEED_RAD_S = 1.5
"""Speed in the middle of a movement [rad/s]."""

PAUSE_S = 0.5
"""Rest between two movements [s]."""

POSITION_BANDWIDTH_RAD_S = 100.0
"""Bandwidth of the position control [rad/s]."""

SPEED_SPAN_SAMPLES = 8.0
"""Number of samples over which a velocity is measured."""

PUBLISHED_EXPONENTS = (-1.0, -1.9)
"""Exponents k of equation 8 of Verdel et al. (Robotica 39, 2021), upwards and downwards."""

ELBOW_LOWPASS_HZ = 8.0
"""Corner of the low-pass filter before the elbow's constants are fitted [Hz]."""


@dataclass(frozen=True)
class ElbowConstants:
    """One elbow's, found with the shoulder held: g_s sin q + g_c cos q + F sign v + N v + J a [N m]."""

    up: np.ndarray  # up, down: (5,) of each direction
    down: np.ndarray
    pooled: np.ndarray  # (5,) of both


def pointing(rate: float) -> HumanMotion:
    """Up and down with the elbow alone, minimum jerk, a rest between, at a `rate` [Hz]."""
    at = np.array([*SHOULDER_POSTURE_RAD, LOWEST_ELBOW_ANGLE_RAD])
    parts = [np.repeat(at[None], round(1.5 * rate), axis=0)]
    for reach in REACH_AMPLITUDES_RAD:
        for sign in (1.0, -1.0):
            n = round(1.875 * reach / PEAK_SPEED_RAD_S * rate)
            s = (np.arange(n) + 1.0) / n
            path = np.repeat(parts[-1][-1:], n, axis=0)
            path[:, 3] += sign * reach * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            parts += [path, np.repeat(path[-1:], round(PAUSE_S * rate), axis=0)]
    return HumanMotion("pointing", "pointing with the elbow", rate, np.concatenate(parts))


def elbow_constants(rig: ArmRig, slider: float, *, seed: int = 1) -> ElbowConstants:
    """By least squares from slow and fast elbow movements with the shoulder held; the carriage at `slider` [m]."""
    from scipy.signal import butter, sosfiltfilt

    rate, rng = rig.constants.sampling.rate, np.random.default_rng([seed, 12])
    time = np.arange(round(30.0 * rate)) / rate
    path = np.repeat([[*SHOULDER_POSTURE_RAD, 0.0]], len(time), axis=0)
    # Slow first, then up to the speed of movements: friction by itself, then with inertia.
    phase = 2.0 * np.pi * (0.08 * time + 0.5 * 0.012 * time**2)
    path[:, 3] = LOWEST_ELBOW_ANGLE_RAD + 0.5 * max(REACH_AMPLITUDES_RAD) * (1.0 - np.cos(phase))
    plant = rig.plant(slider=slider)
    plant.reset(path[0])
    command, measured, _, _ = plant.follow(
        path,
        np.array(gains_of(rig)),
        loop="cascade",
        velocity_span=rig.constants.sampling.velocity_span,
        quantum=rig.quanta,
        noise=rig.constants.encoder.noise * rng.standard_normal(path.shape),
    )
    sos = butter(2, ELBOW_LOWPASS_HZ, fs=rate, output="sos")
    q, torque = (sosfiltfilt(sos, x[:, 3]) for x in (measured, rig.gains * command))
    v = np.gradient(q, 1.0 / rate)
    a = np.gradient(v, 1.0 / rate)
    inner = np.zeros(len(q), bool)
    inner[round(0.5 * rate) : -round(0.5 * rate) : 10] = True
    rows = np.column_stack([np.sin(q), np.cos(q), np.sign(v), v, a])

    def fitted(kept: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(rows[kept], torque[kept], rcond=None)[0]

    return ElbowConstants(*(fitted(inner & moving) for moving in (v > 0.05, v < -0.05, np.abs(v) > 0.05)))


def position_control(rig: ArmRig, constants: ElbowConstants) -> ControlLaw:
    """The constructor's: sent each period to where the elbow would be in one, gravity and dry friction of both
    directions (CLPC)."""
    sine, cosine, coulomb, _, inertia = constants.pooled
    values = {
        "gravity_sine": sine,
        "gravity_cosine": cosine,
        "coulomb": max(coulomb, 0.0),
        "stiffness": max(inertia, 0.0) * POSITION_BANDWIDTH_RAD_S**2,
        "dead_band": 0.02,
        "speed_span": SPEED_SPAN_SAMPLES,
        **_gate(rig),
    }
    return ControlLaw(POSITION_PREDICTION_LAW.name, {name: float(x) for name, x in values.items()})


def full_compensation(rig: ArmRig, constants: ElbowConstants) -> ControlLaw:
    """Open-loop compensation by direction, friction with it (FC)."""
    values: dict[str, float] = {}
    for name, own, k in zip(("up", "down"), (constants.up, constants.down), PUBLISHED_EXPONENTS, strict=True):
        sine, cosine, coulomb, viscous, inertia = own
        keys = ("gravity_sine", "gravity_cosine", "coulomb", "viscous", "inertia", "exponent")
        values |= {
            f"{key}_{name}": float(x)
            for key, x in zip(keys, (sine, cosine, coulomb, viscous, max(inertia, 0.0), k), strict=True)
        }
    largest = max(values["inertia_up"], values["inertia_down"])
    values |= {"dead_band": 0.05, "inertia_limit": 8.0 * largest, "speed_span": SPEED_SPAN_SAMPLES, **_gate(rig)}
    return ControlLaw(DIRECTIONAL_LAW.name, values)


def _gate(rig: ArmRig) -> dict[str, float]:
    effort = float(rig.limits[3])
    return gate_values(Limits(effort, 100.0 * effort, 8.0, (-0.5, 2.8)), 1.0 / rig.constants.sampling.rate)


LAWS: Mapping[str, Callable[[ArmRig, ElbowConstants], ControlLaw]] = {
    "clpc": position_control,
    "fc": full_compensation,
}
"""Functions that build the elbow's law from its constants, by the law's name."""

SHOULDER_CONDITIONS = ("held", "free", "moving")
"""Conditions of the shoulder: held by the robot's loops; free and kept still by the wearer; free and moving."""


class ElbowAndShoulder:
    """A law of the elbow, and a shoulder that is held where it was at first, or free."""

    def __init__(self, rig: ArmRig, elbow: ControlLaw, *, held: bool):
        self.rig, self.elbow, self.held = rig, elbow, held
        self.period, self.span = 1.0 / rig.constants.sampling.rate, rig.constants.sampling.velocity_span
        self.kp, self.ki, _, self.kv, _ = np.array(gains_of(rig))[:3].T
        self.reset()

    def reset(self) -> None:
        """Everything at rest."""
        self.running = self.elbow.start()
        self.seen: list[np.ndarray] = []
        self.integral = np.zeros(3)

    def step(self, time: float, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Torque asked of each joint, shape (4,) [N m], at `time` [s], `position` (4,) [rad]; no `wrench` is read."""
        weight = self.rig.gravity(position)
        asked = np.append(weight[:3], self.running.step(time, float(position[3])))
        if not self.held:
            return asked
        self.seen = [*self.seen[-self.span :], position[:3]]
        speed = (self.seen[-1] - self.seen[0]) / (max(len(self.seen) - 1, 1) * self.period)
        error = self.kp * (np.array(SHOULDER_POSTURE_RAD) - position[:3]) - speed
        self.integral = self.integral + error * self.period
        asked[:3] += self.rig.gains[:3] * (self.kv * error + self.ki * self.integral)
        return asked


@dataclass(frozen=True)
class ShoulderFigures:
    """What one law was like with the shoulder one way."""

    law: str  # "clpc" or "fc"
    shoulder: str  # One of `SHOULDER_CONDITIONS`
    elbow_interaction: float  # RMS of the torque at the wearer's elbow [N m]
    shoulder_interaction: float  # RMS over the shoulder's three joints [N m]
    elbow_error: float  # RMS of how far the elbow is from where it was meant to be [rad]
    shoulder_moved: float  # RMS of the wearer's shoulder about where it was meant to be [rad]
    shoulder_peak: float  # Largest of it [rad]
    exchanged: float  # Work to and fro between both [J]
    stopped: bool  # Whether nothing held any more


def figures_of(trial: WornTrial, law: str, shoulder: str) -> ShoulderFigures:
    """Return the figures of a trial under a law of the elbow, with a condition of the shoulder."""
    counted = trial.counted
    off = (trial.limb - trial.motion.position[: len(trial.limb)])[counted]
    torque = trial.on_limb[counted]
    return ShoulderFigures(
        law,
        shoulder,
        float(np.sqrt(np.mean(torque[:, 3] ** 2))),
        float(np.sqrt(np.mean(torque[:, :3] ** 2))),
        float(np.sqrt(np.mean(off[:, 3] ** 2))),
        float(np.sqrt(np.mean(off[:, :3] ** 2))),
        float(np.abs(off[:, :3]).max()),
        trial.exchanged,
        trial.stopped,
    )


def compare_shoulders(rig: ArmRig, person: Person, *, seed: int = 1) -> tuple[ShoulderFigures, ...]:
    """Both laws with the shoulder each way, on one robot and one person."""
    elbow_alone = pointing(rig.constants.sampling.rate)
    constants = elbow_constants(rig, HANDLE_AT * person.forearm, seed=seed)
    made = []
    for name, build in LAWS.items():
        for shoulder in SHOULDER_CONDITIONS:
            motion = motion_of(person, rig, seed=seed) if shoulder == "moving" else elbow_alone
            law = ElbowAndShoulder(rig, build(rig, constants), held=shoulder == "held")
            made.append(figures_of(run(rig, person, law, motion, seed=seed), name, shoulder))
    return tuple(made)
