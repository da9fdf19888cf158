"""What the virtual arm is asked to do: Fourier motions of all joints, slow ones of each, and reaching as people do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellucid.arm.protocols.tree_fourier import TreeFourier, random_tree_fourier, shrink_within_limits
from pellucid.numerics.protocols.step_by_step import step_by_step
from pellucid.numerics.protocols.tree_limits import TreeLimits

from ..rig import Trial
from .human_motion import JOINTS, HumanMotion, generated_motion
from .machine import ArmMachine

FUNDAMENTAL_HZ = 0.1
"""Fundamental frequency of Fourier motions, which repeat after 10 s [Hz]."""

HARMONIC_COUNT = 8
"""Number of harmonics of Fourier motions."""

DRAWN_MOTION_COUNT = 40
"""Number of drawn Fourier motions, of which the most informative is kept."""

REST_S = 1.0
"""Rest before and after every motion [s]."""

STOP_MARGIN_RAD = 0.06
"""Distance of all motions from the joints' stops [rad]."""

REACHING_DURATION_S = 40.0
"""Duration of the recording of reaching [s]."""


@dataclass(frozen=True)
class ArmTrial(Trial):
    """One recording of the robot alone. `name`, `protocol`, `use`, `reference` (n, 4) [rad]."""

    slider: float = 0.0  # Where the carriage is clamped [m]


def limits_of(rig: ArmMachine, *, share: float = 0.85) -> TreeLimits:
    """What protocols keep to: the stops with a margin, and a `share` of what drives allow."""
    said = [rig.constants.joint[name] for name in JOINTS]
    low, high = (np.array([getattr(s, key) for s in said]) for key in ("low", "high"))
    velocity, acceleration = (share * np.array([getattr(s, key) for s in said]) for key in ("velocity", "acceleration"))
    effort = share * np.array([s.torque_constant * s.gear_ratio * s.current_limit for s in said])
    tree = rig.drawing.core

    def needed(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        # What the drawing knows, and as much again of what it does not: friction, cables.
        return 1.4 * np.abs(tree.inverse_dynamics(*map(np.ascontiguousarray, (q, v, a)))) + 1.0

    return TreeLimits(JOINTS, low + STOP_MARGIN_RAD, high - STOP_MARGIN_RAD, velocity, acceleration, effort, needed)


def fourier(rig: ArmMachine, seed: int) -> TreeFourier:
    """The motion that shows a drawing's bodies and their friction best, of some that are drawn within the limits."""
    limits, rng = limits_of(rig), np.random.default_rng([seed, 16])
    time = np.arange(round(1.0 / FUNDAMENTAL_HZ * 20.0)) / 20.0
    tree = rig.drawing.core

    def worth(series: TreeFourier) -> float:
        q, v, a = series.motion(time)
        rows = tree.regressor(*map(np.ascontiguousarray, (q, v, a))).reshape(len(time) * len(JOINTS), -1)
        # Columns that are sums of others have no singular value of their own: what the rest holds is counted.
        singular = np.linalg.svd(rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-9), compute_uv=False)
        shown = singular[singular > 1e-8 * singular[0]]
        return float(np.log(shown).sum() / len(shown) + 0.2 * np.log(np.abs(v).mean(axis=0)).sum())

    made = [
        random_tree_fourier(limits, rng, fundamental=FUNDAMENTAL_HZ, harmonics=HARMONIC_COUNT)
        for _ in range(DRAWN_MOTION_COUNT)
    ]
    return shrink_within_limits(max(made, key=worth), limits)


def _led(path: np.ndarray, rate: float) -> np.ndarray:
    """With rest before and after, shape (n, 4) [rad]."""
    rest = round(REST_S * rate)
    return np.concatenate([np.repeat(path[:1], rest, axis=0), path, np.repeat(path[-1:], rest, axis=0)])


def fourier_path(rig: ArmMachine, seed: int) -> np.ndarray:
    """Whole periods of `fourier`, shape (n, 4) [rad]."""
    rate = rig.constants.sampling.rate
    periods = max(round(rig.constants.protocol.duration * FUNDAMENTAL_HZ), 1)
    time = np.arange(round(periods / FUNDAMENTAL_HZ * rate)) / rate
    return _led(fourier(rig, seed).motion(time)[0], rate)


def slow_path(rig: ArmMachine) -> np.ndarray:
    """One joint after another up and down at constant velocities, shape (n, 4) [rad]."""
    limits, rate = limits_of(rig, share=rig.constants.protocol.slow_share), rig.constants.sampling.rate
    posture = 0.5 * (limits.low + limits.high)
    made = step_by_step(limits, rate, posture=posture, angles=0, velocities=2, ratio=3.0, slow=0, sweep=0.5)
    kept = [made.position[s.first : s.last] for s in made.steps if s.kind == "constant"]
    return _led(np.concatenate(kept), rate)


def followed(motion: HumanMotion, *, slider: float, use: str = "validate") -> ArmTrial:
    """The robot alone on a person's motion."""
    return ArmTrial(f"reaching_{motion.name}", "reaching", use, reference=motion.position, slider=slider)


def trials(rig: ArmMachine, seed: int) -> tuple[ArmTrial, ...]:
    """Fourier motions and slow ones that are fitted; another Fourier motion and reaching that are not."""
    slider, rate = rig.constants.slider.clamped, rig.constants.sampling.rate
    made: list[ArmTrial] = []
    count = rig.constants.protocol.repetitions

    def add(name: str, protocol: str, use: str, path: np.ndarray) -> None:
        made.append(ArmTrial(name, protocol, use, reference=path, slider=slider))

    for i in range(count + 1):
        name, use = (f"fourier_{i + 1}", "fit") if i < count else ("fourier_unseen", "validate")
        add(name, "fourier", use, fourier_path(rig, 10 * seed + i))
    add("slow", "constant_velocity", "fit", slow_path(rig))
    made.append(followed(generated_motion(seed, rate, REACHING_DURATION_S), slider=slider))
    return tuple(made)


def gains_of(rig: ArmMachine) -> Sequence[Sequence[float]]:
    """Return kp, ki, kd, kv and the effort limit of the robot's own loop at each joint."""
    rows = []
    for name in JOINTS:
        loop = rig.constants.loop[name]
        rows.append([loop.kp, loop.ki, 0.0, loop.kv, rig.constants.joint[name].current_limit])
    return rows
