"""The coupled plant written again, plainly, in Python floats: one number at a time."""

from __future__ import annotations

import math

import geared_reference
import numpy as np

NAMES = (
    "motor_inertia", "coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative", "stribeck",
    "stribeck_velocity", "load_motoring", "load_generating", "load_rise", "friction_swing", "friction_wave_number",
    "viscous_decline", "spring_stiffness", "spring_damping", "orthosis_inertia", "gravity_sine", "gravity_cosine",
    "bearing_coulomb", "bearing_viscous", "strap_stiffness", "strap_damping", "strap_slack", "strap_hold",
    "strap_mobility", "limb_inertia", "limb_gravity", "limb_centre", "limb_viscous", "passive_torque", "passive_angle",
    "passive_scale", "torque_kp", "torque_ki", "torque_kd", "torque_limit", "motor_limit", "calibrated_stiffness",
    "motor_quantum", "output_quantum",
)  # fmt: skip

EXAMPLE = dict(
    motor_inertia=0.1, coulomb_positive=0.6, coulomb_negative=0.5, viscous_positive=0.4, viscous_negative=0.5,
    stribeck=0.3, stribeck_velocity=0.1, load_motoring=0.08, load_generating=0.15, load_rise=0.5, friction_swing=0.2,
    friction_wave_number=9.0, viscous_decline=2.0, spring_stiffness=170.0, spring_damping=0.1, orthosis_inertia=0.05,
    gravity_sine=1.5, gravity_cosine=0.05, bearing_coulomb=0.02, bearing_viscous=0.01, strap_stiffness=20.0,
    strap_damping=0.5, strap_slack=0.0, strap_hold=2.0, strap_mobility=0.1, limb_inertia=0.3, limb_gravity=8.0,
    limb_centre=0.05, limb_viscous=0.15, passive_torque=1.0, passive_angle=-0.09, passive_scale=0.03, torque_kp=1.0,
    torque_ki=3.0, torque_kd=0.01, torque_limit=25.0, motor_limit=30.0, calibrated_stiffness=171.0,
    motor_quantum=2e-5, output_quantum=1e-4,
)  # fmt: skip

OUTPUTS = (
    "position", "motor_position", "torque", "orthosis_position", "orthosis_velocity", "limb_position", "limb_velocity",
    "strap_torque", "spring_torque", "motor_torque",
)  # fmt: skip


def parameters(**changes: float) -> np.ndarray:
    """The example with some parameters changed, in the core's order."""
    values = EXAMPLE | changes
    assert set(values) == set(NAMES)
    return np.array([values[name] for name in NAMES])


def random_parameters(rng: np.random.Generator, **fixed: float) -> np.ndarray:
    ranges = dict(
        motor_inertia=(0.03, 0.2), coulomb_positive=(0, 3), coulomb_negative=(0, 3), viscous_positive=(0, 1),
        viscous_negative=(0, 1), stribeck=(0, 1), stribeck_velocity=(0.02, 0.5), load_motoring=(0, 0.3),
        load_generating=(0, 0.5), load_rise=(0, 1), friction_swing=(0, 0.5), friction_wave_number=(1, 20),
        viscous_decline=(0.5, 5), spring_stiffness=(80, 300), orthosis_inertia=(0.03, 0.1), gravity_sine=(0, 3),
        strap_stiffness=(5, 60), strap_damping=(0, 2), strap_slack=(-0.05, 0.05), strap_hold=(0.1, 3),
        strap_mobility=(0, 0.2), limb_inertia=(0.2, 0.7), limb_gravity=(5, 15), passive_torque=(0, 2),
        torque_kp=(0, 1.5), torque_ki=(0, 5), torque_kd=(0, 0.02), motor_limit=(3, 30), torque_limit=(5, 30),
    )  # fmt: skip
    return parameters(**{name: rng.uniform(*range_) for name, range_ in ranges.items()} | fixed)


class Plant:
    """What `_core.CoupledPlant` is."""

    def __init__(self, parameters, *, period, substeps=10, delay=0, torque_span=1, position0=0.0, torque0=0.0):
        self.p = p = dict(zip(NAMES, parameters, strict=True))
        self.period, self.substeps, self.delay, self.span = period, substeps, delay, torque_span
        load = self.weight(position0) - torque0
        self.q_e = position0
        self.q_m = position0 + torque0 / p["spring_stiffness"]
        self.q_k = position0
        if p["strap_stiffness"] > 0 and load != 0:
            self.q_k += load / p["strap_stiffness"] + math.copysign(0.5 * max(p["strap_slack"], 0.0), load)
        self.v_m = self.v_e = self.v_k = self.slip = self.integral = 0.0
        settled = p["calibrated_stiffness"] * (self.q_m - self.q_e)
        self.torques, self.commands = [settled] * 8, [settled] * 8

    def weight(self, q: float) -> float:
        return self.p["gravity_sine"] * math.sin(q) + self.p["gravity_cosine"] * math.cos(q)

    def spring(self) -> float:
        p = self.p
        return p["spring_stiffness"] * (self.q_m - self.q_e) + p["spring_damping"] * (self.v_m - self.v_e)

    def strap(self) -> float:
        p = self.p
        mismatch, rate = self.q_k - self.q_e - self.slip, self.v_k - self.v_e
        gap = 0.5 * p["strap_slack"]
        if gap <= 0:
            return p["strap_stiffness"] * mismatch + p["strap_damping"] * rate
        if abs(mismatch) <= gap:
            return 0.0
        pull = p["strap_stiffness"] * (abs(mismatch) - gap) + p["strap_damping"] * math.copysign(1.0, mismatch) * rate
        return math.copysign(max(pull, 0.0), mismatch)

    def read(self) -> tuple[float, ...]:
        p = self.p
        position = round(self.q_e / p["output_quantum"]) * p["output_quantum"]
        motor = round(self.q_m / p["motor_quantum"]) * p["motor_quantum"]
        torque = p["calibrated_stiffness"] * (motor - position)
        strap = self.strap()
        return (
            position, motor, torque, self.q_e, self.v_e, self.q_k, self.v_k, strap + 0.0, self.spring(), 0.0,
        )  # fmt: skip

    def command(self, desired: float, measured: float) -> float:
        p = self.p
        wanted = min(max(desired, -p["torque_limit"]), p["torque_limit"])
        error = wanted - measured
        rate = (measured - self.torques[-self.span]) / (self.span * self.period)
        proportional = wanted + p["torque_kp"] * error - p["torque_kd"] * rate
        integral = self.integral + error * self.period
        whole = proportional + p["torque_ki"] * integral
        if not (abs(whole) > p["motor_limit"] and error * whole > 0):
            self.integral = integral
        whole = proportional + p["torque_ki"] * self.integral
        self.torques.append(measured)
        self.commands.append(min(max(whole, -p["motor_limit"]), p["motor_limit"]))
        return self.commands[-1 - self.delay]

    def step(self, desired: float, muscle: float, slip_jump: float = 0.0) -> tuple[float, ...]:
        p, h = self.p, self.period / self.substeps
        u = self.command(desired, self.read()[2])
        self.slip += slip_jump
        for _ in range(self.substeps):
            spring, strap = self.spring(), self.strap()
            net = u - spring
            up = self.v_m > 0 if self.v_m != 0 else net > 0
            viscous = (p["viscous_positive"] if up else p["viscous_negative"]) * self.v_m
            if p["viscous_decline"] > 0:
                viscous /= 1 + abs(self.v_m) / p["viscous_decline"]
            hold = geared_reference.dry(p, self.q_m, 0.0, spring, net > 0)
            dry = geared_reference.dry(p, self.q_m, self.v_m, spring, up)
            v_m = geared_reference.after(self.v_m, net, hold, dry, viscous, p["motor_inertia"], h)
            net, bearing = spring + strap - self.weight(self.q_e), p["bearing_coulomb"]
            slowed = p["bearing_viscous"] * self.v_e
            v_e = geared_reference.after(self.v_e, net, bearing, bearing, slowed, p["orthosis_inertia"], h)
            depth = min((p["passive_angle"] - self.q_k) / p["passive_scale"], 5.0)
            tissue = p["passive_torque"] * math.exp(depth) - p["limb_viscous"] * self.v_k
            weight = p["limb_gravity"] * math.sin(self.q_k - p["limb_centre"])
            self.v_k += h * (muscle - strap - weight + tissue) / p["limb_inertia"]
            self.v_m, self.v_e = v_m, v_e
            self.q_m += h * v_m
            self.q_e += h * v_e
            self.q_k += h * self.v_k
            beyond = abs(strap) - p["strap_hold"]
            self.slip += h * p["strap_mobility"] * math.copysign(max(beyond, 0.0), strap)
        return (*self.read()[:-1], u)
