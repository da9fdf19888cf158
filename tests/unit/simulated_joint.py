"""A joint with true stiction that somebody holds or moves, and a supervised law that drives it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

import pellucid as pl
from pellucid import _core
from pellucid.controllers.supervised import SupervisedLaw
from pellucid.joint.fit.joint_estimate import JointEstimate
from pellucid.models.joint import FAMILIES

SUBSTEPS = 3

BODY = {
    "inertia": 0.05, "gravity_sine": 1.5, "coulomb_positive": 0.3, "coulomb_negative": 0.3, "viscous_positive": 0.08,
    "viscous_negative": 0.08,
}  # fmt: skip
"""A joint with symmetric friction, by the core's names, SI."""

FRICTION: Mapping[str, Mapping[str, float]] = {
    "symmetric": {},
    "directional": {"coulomb_positive": 0.35, "coulomb_negative": 0.25, "viscous_positive": 0.1},
    "load": {"load_motoring": 0.12, "load_generating": 0.12},
    "stribeck": {"stribeck": 0.15, "stribeck_velocity": 0.1},
    "combined": {
        "coulomb_positive": 0.35, "load_motoring": 0.12, "load_generating": 0.12, "stribeck": 0.15,
        "stribeck_velocity": 0.1,
    },
    "root": {"square_root": 0.5},
}  # fmt: skip
"""What each friction family adds to it, or says otherwise."""
assert set(FRICTION) == set(FAMILIES)


@dataclass
class SimulatedJoint:
    """A joint of a `body` by the core's names, SI; `hold` is the stiffness of a hand, which carries its weight at
    first, and `arm` the inertia that comes with it."""

    body: Mapping[str, float]
    position: float  # [rad or m]
    hold: float = 0.0
    arm: float = 0.0
    gain: float = 1.0  # of the drive
    velocity: float = 0.0
    reached: float = 0.0  # largest distance from the start
    felt: float = 0.0  # the hand's torque, which a force sensor measures
    _target: float = field(init=False, default=0.0)
    _start: float = field(init=False, default=0.0)

    def __post_init__(self):
        self._start = self.position
        if self.hold:
            self._target = self.position + self.weight() / self.hold

    def weight(self) -> float:
        """Gravity and offset where it is."""
        b = self.body
        sine, cosine = b.get("gravity_sine", 0.0), b.get("gravity_cosine", 0.0)
        return sine * math.sin(self.position) + cosine * math.cos(self.position) + b.get("offset", 0.0)

    def friction(self, direction: float) -> float:
        """What resists a motion, or its beginning, in a direction."""
        b, speed, load = self.body, abs(self.velocity), self.weight()
        way = "positive" if direction > 0.0 else "negative"
        side = "motoring" if load * direction > 0.0 else "generating"
        level = b.get(f"coulomb_{way}", 0.0) + b.get(f"load_{side}", 0.0) * abs(load)
        if b.get("stribeck_velocity", 0.0) > 0.0:
            level += b.get("stribeck", 0.0) * math.exp(-((speed / b["stribeck_velocity"]) ** 2))
        return level + b.get(f"viscous_{way}", 0.0) * speed + b.get("square_root", 0.0) * math.sqrt(speed)

    def can_rest(self) -> bool:
        """Whether friction alone keeps it where it is."""
        weight = self.weight()
        return abs(weight) <= self.friction(-weight)

    def step(self, effort: float, period: float, wanted_velocity: float = 0.0) -> None:
        """One period under an effort of the drive; the hand moves with a velocity."""
        inertia, h = self.body["inertia"] + self.arm, period / SUBSTEPS
        damping = 1.4 * math.sqrt(self.hold * inertia)
        for _ in range(SUBSTEPS):
            self._target += h * wanted_velocity
            self.felt = self.hold * (self._target - self.position) + damping * (wanted_velocity - self.velocity)
            net = self.gain * effort + self.felt - self.weight()
            if self.velocity == 0.0 and abs(net) <= self.friction(net):
                continue
            direction = math.copysign(1.0, self.velocity if self.velocity else net)
            moved = self.velocity + h * (net - direction * self.friction(direction)) / inertia
            self.velocity = 0.0 if moved * self.velocity < 0.0 else moved
            self.position += h * self.velocity
        self.reached = max(self.reached, abs(self.position - self._start))


def changed(body: Mapping[str, float], inertia: float, gravity: float, friction: float) -> dict[str, float]:
    """A body with other inertia, gravity and friction, by factors."""
    factors = {"inertia": inertia, "stribeck_velocity": 1.0, "offset": gravity}
    return {
        name: value * factors.get(name, gravity if name.startswith("gravity") else friction)
        for name, value in body.items()
    }


def live(
    law: SupervisedLaw,
    joint: SimulatedJoint,
    seconds: float,
    moved: Callable[[float], float] = lambda _: 0.0,
    resolution: float = 0.0,
) -> tuple[str, str, float]:
    """Fault, mode and time [s] after so many `seconds`, or when the first fault came. The hand moves by `moved` of the
    time since the law runs; the encoder reads in steps of a `resolution`."""
    running, period, start = law.start(), law.values["period"], 0.0
    # A force sensor says what the hand gives; EMG says nothing but noise; what else there is stays silent.
    sensors = [name if name in law.law.uses else None for name in law.sensors[1:]]
    for i in range(round(seconds / period)):
        t = period * i
        read = resolution * round(joint.position / resolution) if resolution else joint.position
        said = {None: None, "interaction": joint.felt, "muscle": 1e-4 * (i % 7)}
        effort = running.step(t, read, *(said[name] for name in sensors))
        if running.fault != "none":
            return running.fault, running.mode, t
        if running.mode == "start_up":
            start = t
        joint.step(effort, period, moved(t - start) if running.mode == "running" else 0.0)
    return running.fault, running.mode, seconds


def identified(body: Mapping[str, float], family: str, noise: float = 0.02) -> JointEstimate:
    """What `fit_joint` finds of a body that moves as a sum of sines, with `noise` in its effort."""
    t = np.arange(0.0, 30.0, 4e-3)
    q, v, a = np.zeros(len(t)), np.zeros(len(t)), np.zeros(len(t))
    for size, hertz, phase in ((0.5, 0.13, 0.0), (0.3, 0.47, 1.0), (0.15, 1.1, 2.0)):
        w = 2.0 * np.pi * hertz
        q += size * np.sin(w * t + phase)
        v += size * w * np.cos(w * t + phase)
        a -= size * w**2 * np.sin(w * t + phase)
    vector = np.array([body.get(name, 0.0) for name in _core.PARAMETER_NAMES])
    effort = _core.inverse_dynamics(vector, q, v, a) + noise * np.random.default_rng(1).standard_normal(len(t))
    gravity = "sine" if body.get("gravity_sine") else "none"
    return pl.fit_joint(t, q, effort, friction=family, gravity=gravity, lowpass=10.0, decimate=3)
