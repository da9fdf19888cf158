"""The coupled plant written again, plainly, in Python floats: one number at a time."""

from __future__ import annotations

import math

import geared_reference
import numpy as np
import scipy.optimize

NAMES = (
    "motor_inertia", "coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative", "stribeck",
    "stribeck_velocity", "load_motoring", "load_generating", "square_root", "load_rise", "friction_swing",
    "friction_wave_number",
    "viscous_decline", "presliding_travel", "spring_stiffness", "spring_damping", "orthosis_inertia", "gravity_sine",
    "gravity_cosine",
    "bearing_coulomb", "bearing_viscous", "strap_stiffness", "strap_damping", "strap_slack", "strap_hold",
    "strap_mobility", "strap_hardening", "strap_relaxing_stiffness", "strap_relaxation_time", "strap_across",
    "strap_along", "strap_fitted", "limb_inertia", "limb_gravity", "limb_centre", "limb_viscous", "passive_torque",
    "passive_angle", "passive_scale", "torque_kp", "torque_ki", "torque_kd", "torque_limit", "motor_limit",
    "calibrated_stiffness", "motor_quantum", "output_quantum",
)  # fmt: skip

EXAMPLE = dict(
    motor_inertia=0.1, coulomb_positive=0.6, coulomb_negative=0.5, viscous_positive=0.4, viscous_negative=0.5,
    stribeck=0.3, stribeck_velocity=0.1, load_motoring=0.08, load_generating=0.15, load_rise=0.5, friction_swing=0.2,
    friction_wave_number=9.0, viscous_decline=2.0, presliding_travel=0.0, spring_stiffness=170.0, spring_damping=0.1,
    orthosis_inertia=0.05,
    gravity_sine=1.5, gravity_cosine=0.05, bearing_coulomb=0.02, bearing_viscous=0.01, strap_stiffness=20.0,
    strap_damping=0.5, strap_slack=0.0, strap_hold=2.0, strap_mobility=0.1, strap_hardening=0.0,
    strap_relaxing_stiffness=0.0, strap_relaxation_time=0.0, strap_across=0.0, strap_along=0.0, strap_fitted=0.0,
    limb_inertia=0.3, limb_gravity=8.0,
    limb_centre=0.05, limb_viscous=0.15, passive_torque=1.0, passive_angle=-0.09, passive_scale=0.03, torque_kp=1.0,
    torque_ki=3.0, torque_kd=0.01, torque_limit=25.0, motor_limit=30.0, calibrated_stiffness=171.0,
    motor_quantum=2e-5, output_quantum=1e-4, square_root=0.1,
)  # fmt: skip

OUTPUTS = (
    "position", "motor_position", "torque", "orthosis_position", "orthosis_velocity", "limb_position", "limb_velocity",
    "strap_torque", "spring_torque", "motor_torque", "limb_torque",
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
    of_strap = dict(
        strap_hardening=(-0.2, 0.4), strap_relaxing_stiffness=(-20, 30), strap_relaxation_time=(0.1, 2),
        strap_across=(-0.2, 0.2), strap_along=(-0.2, 0.2), strap_fitted=(-1, 1),
    )  # fmt: skip
    drawn = {name: rng.uniform(*range_) for name, range_ in ranges.items()}
    apart = rng.spawn(1)[0]
    drawn |= {name: apart.uniform(*range_) for name, range_ in of_strap.items()}
    drawn["strap_relaxing_stiffness"] = max(drawn["strap_relaxing_stiffness"], 0.0)
    return parameters(**drawn | fixed)


class Plant:
    """What `_core.CoupledPlant` is."""

    def __init__(self, parameters, *, period, substeps=10, delay=0, torque_span=1, position0=0.0, torque0=0.0):
        self.p = p = dict(zip(NAMES, parameters, strict=True))
        self.period, self.substeps, self.delay, self.span = period, substeps, delay, torque_span
        through, lever = self.alignment(position0)
        load = (self.weight(position0) - torque0) / lever
        self.q_e = position0
        self.q_m = position0 + torque0 / p["spring_stiffness"]
        self.q_k, self.flow = through, 0.0
        if p["strap_stiffness"] > 0 and load != 0:
            size = self.cubic() * p["strap_stiffness"]
            stretch = scipy.optimize.brentq(
                lambda e: p["strap_stiffness"] * e + size * e**3 - load, -10.0, 10.0, xtol=1e-14, rtol=1e-14
            )
            self.q_k += stretch + math.copysign(0.5 * max(p["strap_slack"], 0.0), load)
            self.flow = stretch
        self.v_m = self.v_e = self.v_k = self.slip = self.integral = 0.0
        self.contacts = geared_reference.Contacts(p["presliding_travel"])
        settled = p["calibrated_stiffness"] * (self.q_m - self.q_e)
        self.torques, self.commands = [settled] * 8, [settled] * 8

    def weight(self, q: float) -> float:
        return self.p["gravity_sine"] * math.sin(q) + self.p["gravity_cosine"] * math.cos(q)

    def spring(self) -> float:
        p = self.p
        return p["spring_stiffness"] * (self.q_m - self.q_e) + p["spring_damping"] * (self.v_m - self.v_e)

    def cubic(self) -> float:
        doubled = self.p["strap_hardening"]
        return 1.0 / (3.0 * doubled**2) if doubled > 0 else 0.0

    def alignment(self, q: float) -> tuple[float, float]:
        """Where the limb goes through the cuff, and its slope."""
        p = self.p

        def off(q: float) -> float:
            return p["strap_along"] * math.sin(q) - p["strap_across"] * math.cos(q)

        return q + off(q) - off(p["strap_fitted"]), 1 + p["strap_along"] * math.cos(q) + p["strap_across"] * math.sin(q)

    def stretch(self) -> float:
        mismatch = self.q_k - self.alignment(self.q_e)[0] - self.slip
        return math.copysign(max(abs(mismatch) - 0.5 * max(self.p["strap_slack"], 0.0), 0.0), mismatch)

    def strap(self) -> tuple[float, float]:
        """On the orthosis, and against the limb."""
        p, lever, e = self.p, self.alignment(self.q_e)[1], self.stretch()
        pull = p["strap_stiffness"] * (e + self.cubic() * e**3) + p["strap_relaxing_stiffness"] * (e - self.flow)
        pull += p["strap_damping"] * (self.v_k - lever * self.v_e)
        if p["strap_slack"] > 0 and (e == 0 or (pull > 0) != (e > 0)):
            pull = 0.0
        return lever * pull, pull

    def read(self) -> tuple[float, ...]:
        p = self.p
        position = round(self.q_e / p["output_quantum"]) * p["output_quantum"]
        motor = round(self.q_m / p["motor_quantum"]) * p["motor_quantum"]
        torque = p["calibrated_stiffness"] * (motor - position)
        strap, against = self.strap()
        return (
            position, motor, torque, self.q_e, self.v_e, self.q_k, self.v_k, strap, self.spring(), 0.0, against,
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

    def step(
        self, desired: float, muscle: float, slip_jump: float = 0.0, base_torque: float = 0.0
    ) -> tuple[float, ...]:
        p, h = self.p, self.period / self.substeps
        u = self.command(desired, self.read()[2])
        self.slip += slip_jump
        for _ in range(self.substeps):
            spring, (strap, against), stretch = self.spring(), self.strap(), self.stretch()
            net = u - spring
            v_m = geared_reference.motor_after(p, self.contacts, self.q_m, self.v_m, net, spring, 0.0, h)
            net, bearing = spring + strap + base_torque - self.weight(self.q_e), p["bearing_coulomb"]
            slowed = p["bearing_viscous"] * self.v_e
            v_e = geared_reference.after(self.v_e, net, bearing, bearing, slowed, p["orthosis_inertia"], h)
            depth = min((p["passive_angle"] - self.q_k) / p["passive_scale"], 5.0)
            tissue = p["passive_torque"] * math.exp(depth) - p["limb_viscous"] * self.v_k
            weight = p["limb_gravity"] * math.sin(self.q_k - p["limb_centre"])
            self.v_k += h * (muscle - against - weight + tissue) / p["limb_inertia"]
            self.v_m, self.v_e = v_m, v_e
            self.contacts.move(h * v_m)
            self.q_m += h * v_m
            self.q_e += h * v_e
            self.q_k += h * self.v_k
            beyond = abs(against) - p["strap_hold"]
            self.slip += h * p["strap_mobility"] * math.copysign(max(beyond, 0.0), against)
            if p["strap_relaxing_stiffness"] > 0:
                share = h / p["strap_relaxation_time"]
                self.flow = (self.flow + share * stretch) / (1 + share)
        out = self.read()
        return (*out[:-2], u, out[-1])
