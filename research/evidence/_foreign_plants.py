"""Joints that other programs simulate: a MuJoCo hinge with a tendon, and an arm of Pinocchio with a LuGre bristle.

MuJoCo has its own friction: a soft constraint that gives way at low speed, at the joint and along a fixed tendon. The
arm's second joint is locked, so that its first is a joint; Pinocchio computes the acceleration, and a plain integrator
takes the steps. Friction there is a bristle whose level grows with the load that it carries. Reference, controller,
encoder and torque sensor are those of `_foreign_joint.py`; nothing of Pellucid takes part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ._foreign_joint import GRAVITY, RATE_HZ, ForeignJoint, drawn_joint, drawn_sines

STEP_S = 2e-4
"""Step of both integrators [s]."""

TENDON_SHARE = 0.4
"""Share of dry and viscous friction that acts along the MuJoCo joint's tendon."""

ELBOW_ANGLE_RAD = 0.6
"""Angle at which the arm's second joint is locked [rad]."""

Advance = Callable[[float], tuple[float, float]]
"""Holds a torque [N*m] for one period of the controller; returns the angle from hanging and its speed."""


def drawn_plants(rng: np.random.Generator, count: int) -> list[tuple[str, ForeignJoint]]:
    """Return joints of drawn size, for MuJoCo and Pinocchio in turn; those for Pinocchio lose a share of the load."""
    made = []
    for i in range(count):
        joint = drawn_joint(rng)
        if i % 2:
            load, bristle = float(rng.uniform(0.0, 0.12)), float(rng.uniform(200.0, 1000.0))
            joint = replace(joint, load=load, bristle=bristle * joint.coulomb)
        made.append(("pinocchio" if i % 2 else "mujoco", joint))
    return made


@dataclass(frozen=True)
class Sines:
    """Reference of a joint: a sum of sines, each (k,)."""

    turning: np.ndarray  # [rad/s]
    phase: np.ndarray  # [rad]
    size: np.ndarray  # [rad]

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Sines:
        """Return drawn sines."""
        frequency, phase, size = (x[:, 0] for x in drawn_sines(rng, 1))
        return cls(2.0 * np.pi * frequency, phase, size)

    def at(self, time: float) -> tuple[float, float]:
        """Return angle [rad] and speed [rad/s] at a time [s]."""
        angle = self.turning * time + self.phase
        return float(np.sum(self.size * np.sin(angle))), float(np.sum(self.size * self.turning * np.cos(angle)))


def follow(
    joint: ForeignJoint,
    sines: Sines,
    advance: Advance,
    seconds: float,
    beside: Callable[[float], float] = lambda q: 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return time, (n,), with angle and mean torque, (n, 2), of a joint under a PD loop with stiff gains.

    The function `beside` returns the torque against the drive's at an angle [N*m].
    """
    n = round(seconds * RATE_HZ)
    omega = 2.0 * np.pi * 6.0
    kp, kd = joint.inertia * omega**2 + joint.gravity, 1.4 * joint.inertia * omega
    q, v = sines.at(0.0)
    time, rows = np.arange(n) / RATE_HZ, np.empty((n, 2))
    for i in range(n):
        reference, speed = sines.at(time[i])
        torque = kp * (reference - q) + kd * (speed - v) + joint.gravity * np.sin(reference)
        rows[i] = q, torque
        q, v = advance(torque - beside(q))
    rows[1:, 1] = 0.5 * (rows[1:, 1] + rows[:-1, 1])
    return time, rows


def record_plant(engine: str, joint: ForeignJoint, rng: np.random.Generator, seconds: float = 30.0) -> np.ndarray:
    """Return time, position and torque, (n, 3), of a joint that follows sines under a PD loop with stiff gains."""
    sines = Sines.drawn(rng)
    time, rows = follow(joint, sines, plant(engine, joint, *sines.at(0.0)), seconds)
    noise = joint.torque_noise * max(joint.coulomb, 0.1 * joint.gravity)
    rows[:, 0] += joint.position_noise * rng.standard_normal(len(time))
    rows[:, 1] += noise * rng.standard_normal(len(time))
    return np.column_stack([time, rows])


def plant(engine: str, joint: ForeignJoint, q: float, v: float) -> Advance:
    """Return a joint in MuJoCo or Pinocchio from an angle and a speed on."""
    return (_mujoco_joint if engine == "mujoco" else _pinocchio_arm)(joint, q, v)


def advance_in_mujoco(text: str, q: float, v: float) -> Advance:
    """Return a model in MuJoCo's format from the angle and speed of its first joint on, which its only motor drives."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = q, v

    def advance(torque: float) -> tuple[float, float]:
        data.ctrl[0] = torque
        mujoco.mj_step(model, data, nstep=round(1.0 / (RATE_HZ * STEP_S)))
        return float(data.qpos[0]), float(data.qvel[0])

    return advance


def _mujoco_joint(joint: ForeignJoint, q: float, v: float) -> Advance:
    weight = joint.gravity / GRAVITY  # mass times distance
    distance = 0.5 * joint.inertia / weight
    mass, left = weight / distance, joint.inertia - weight * distance
    own = 1.0 - TENDON_SHARE
    return advance_in_mujoco(f"""
<mujoco><option timestep="{STEP_S}" gravity="0 0 -{GRAVITY}" integrator="implicitfast"/>
<worldbody><body><joint name="hinge" axis="0 1 0" damping="{own * joint.viscous}" armature="{0.4 * left}"
  frictionloss="{own * joint.coulomb}"/>
<inertial pos="0 0 -{distance}" mass="{mass}" diaginertia="{0.6 * left} {0.6 * left} {0.6 * left}"/></body></worldbody>
<tendon><fixed damping="{TENDON_SHARE * joint.viscous}" frictionloss="{TENDON_SHARE * joint.coulomb}">
<joint joint="hinge" coef="1"/></fixed></tendon>
<actuator><motor joint="hinge"/></actuator></mujoco>""", q, v)


def _pinocchio_arm(joint: ForeignJoint, q: float, v: float) -> Advance:
    import pinocchio as pin

    arm = _locked_arm(1.0, 1.0)
    moment, inertia, _ = _about_shoulder(arm)
    # The arm has the drawn joint's weight moment, and four fifths of its inertia. A rotor turns with it for the rest.
    length = 0.8 * joint.inertia / joint.gravity * moment / inertia
    arm = _locked_arm(joint.gravity / (moment * length), length)
    _, inertia, hanging = _about_shoulder(arm)
    arm.armature = np.array([joint.inertia - inertia])
    data = arm.createData()
    damping, level = 0.1 * np.sqrt(joint.bristle * joint.inertia), joint.coulomb
    state = np.array([q, v, 0.0])

    def advance(torque: float) -> tuple[float, float]:
        nonlocal level
        for _ in range(round(1.0 / (RATE_HZ * STEP_S))):
            q, v, z = state
            bend = v - joint.bristle * abs(v) / level * z
            friction = joint.bristle * z + damping * bend + joint.viscous * v
            at, turning, net = np.array([q - hanging]), np.array([v]), np.array([torque - friction])
            acceleration = float(pin.aba(arm, data, at, turning, net)[0])
            level = joint.coulomb + joint.load * abs(joint.inertia * acceleration + joint.gravity * np.sin(q))
            state[1] = v + STEP_S * acceleration
            state[0] = q + STEP_S * state[1]
            state[2] = z + STEP_S * bend
        return float(state[0]), float(state[1])

    return advance


def _locked_arm(mass: float, length: float) -> Any:
    """Return a model of two links with masses and lengths of this scale, whose second joint is locked."""
    import pinocchio as pin

    model = pin.Model()
    shoulder = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "shoulder")
    # What is beyond the locked elbow is welded to the shoulder's link.
    turn = pin.rpy.rpyToMatrix(0.0, ELBOW_ANGLE_RAD, 0.0)
    elbow = pin.SE3(turn, np.array([0.0, 0.0, -0.3 * length]))
    for place, reach in ((pin.SE3.Identity(), 0.15), (elbow, 0.12)):
        turning = mass * length**2 * np.diag([0.01, 0.01, 0.002])
        centre = np.array([0.0, 0.0, -reach * length])
        model.appendBodyToJoint(shoulder, pin.Inertia(mass, centre, turning), place)
    return model


def _about_shoulder(arm: Any) -> tuple[float, float, float]:
    """Return weight moment [N*m] and inertia [kg*m^2] about the shoulder, and the joint's angle where the arm hangs."""
    import pinocchio as pin

    data, zero = arm.createData(), np.zeros(1)
    inertia = float(pin.crba(arm, data, zero)[0, 0])
    sideways = float(pin.computeGeneralizedGravity(arm, data, zero)[0])
    forward = float(pin.computeGeneralizedGravity(arm, data, np.array([0.5 * np.pi]))[0])
    # The torque of gravity is forward sin q + sideways cos q.
    return float(np.hypot(forward, sideways)), inertia, float(np.arctan2(sideways, forward))
