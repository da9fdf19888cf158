"""The geared plant written again, plainly, in Python floats: one row, one number at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy_reference import Loop

NAMES = (
    "link_inertia", "gravity_sine", "gravity_cosine", "motor_inertia", "stiffness", "damping", "backlash",
    "coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative", "stribeck", "stribeck_velocity",
    "load_motoring", "load_generating", "square_root", "load_rise", "friction_swing", "friction_wave_number",
    "viscous_decline", "presliding_travel", "bearing_coulomb", "bearing_viscous",
)  # fmt: skip

EXAMPLE = dict(
    link_inertia=0.15, gravity_sine=4.0, gravity_cosine=-0.5, motor_inertia=0.08, stiffness=600.0, damping=1.0,
    backlash=0.01, coulomb_positive=0.6, coulomb_negative=0.5, viscous_positive=0.4, viscous_negative=0.5,
    stribeck=0.3, stribeck_velocity=0.1, load_motoring=0.08, load_generating=0.15, load_rise=0.5, friction_swing=0.2,
    friction_wave_number=9.0, viscous_decline=2.0, presliding_travel=0.0, bearing_coulomb=0.05, bearing_viscous=0.02,
    square_root=0.1,
)  # fmt: skip


def parameters(**changes: float) -> np.ndarray:
    """The example with some parameters changed, in the core's order."""
    values = EXAMPLE | changes
    assert set(values) == set(NAMES)
    return np.array([values[name] for name in NAMES])


def rigid(**values: float) -> np.ndarray:
    """Only what is named; everything else 0."""
    return parameters(**(dict.fromkeys(NAMES, 0.0) | values))


def random_parameters(rng: np.random.Generator, **fixed: float) -> np.ndarray:
    ranges = dict(
        link_inertia=(0.05, 0.4), gravity_sine=(-8, 8), gravity_cosine=(-2, 2), motor_inertia=(0.03, 0.2),
        stiffness=(100, 1500), damping=(0, 2), backlash=(0, 0.03), coulomb_positive=(0, 1.5), coulomb_negative=(0, 1.5),
        viscous_positive=(0, 1), viscous_negative=(0, 1), stribeck=(0, 1), stribeck_velocity=(0.02, 0.5),
        load_motoring=(0, 0.3), load_generating=(0, 0.5), load_rise=(0, 1), friction_swing=(0, 0.5),
        friction_wave_number=(1, 20), viscous_decline=(0.5, 5), presliding_travel=(0, 0), bearing_coulomb=(0, 0.3),
        bearing_viscous=(0, 0.2), square_root=(0, 0.5),
    )  # fmt: skip
    return parameters(**{name: rng.uniform(*range_) for name, range_ in ranges.items()} | fixed)


def gravity(p: dict[str, float], q: float) -> float:
    return p["gravity_sine"] * math.sin(q) + p["gravity_cosine"] * math.cos(q)


def transmitted(p: dict[str, float], twist: float, rate: float) -> float:
    half = 0.5 * p["backlash"]
    if -half <= twist <= half:
        return 0.0
    if twist > half:
        return max(p["stiffness"] * (twist - half) + p["damping"] * rate, 0.0)
    return min(p["stiffness"] * (twist + half) + p["damping"] * rate, 0.0)


def dry(p: dict[str, float], q: float, v: float, torque: float, up: bool) -> float:
    """Level of the motor's dry friction in a direction."""
    rise = math.exp(-((v / p["stribeck_velocity"]) ** 2)) if p["stribeck_velocity"] > 0 else 0.0
    coulomb = p["coulomb_positive"] if up else p["coulomb_negative"]
    coulomb *= 1 + p["friction_swing"] * math.sin(p["friction_wave_number"] * q)
    motoring = torque > 0 if up else torque < 0
    alpha = p["load_motoring"] if motoring else p["load_generating"]
    return coulomb + p["stribeck"] * rise + alpha * (1 + p["load_rise"] * rise) * abs(torque)


def after(v: float, net: float, hold: float, slip: float, viscous: float, inertia: float, h: float) -> float:
    """A body's next velocity: `net` is what moves it at rest, `hold` what stops that, `slip` what resists motion."""
    held = abs(net) <= hold
    if v == 0:
        if held:
            return 0.0
        return v + h * (net - math.copysign(slip, net)) / inertia
    moved = v + h * (net - math.copysign(slip, v) - viscous) / inertia
    return 0.0 if held and moved * v <= 0 else moved


class Contacts:
    """Springs and sliders side by side, which a motion bends: Iwan's elements, each by its deflection from rest."""

    COUNT = 8

    def __init__(self, travel: float):
        self.travel = travel
        self.ends = [travel * (i + 1) / self.COUNT for i in range(self.COUNT)]
        self.bent = [0.0] * self.COUNT

    def share(self) -> float:
        """Of the level of friction, -1 to 1; the last spring is half as stiff as the others."""
        weights = [1.0] * (self.COUNT - 1) + [0.5]
        held, most = (sum(w * b for w, b in zip(weights, x, strict=True)) for x in (self.bent, self.ends))
        return held / most

    def move(self, way: float) -> None:
        self.bent = [min(max(b + way, -end), end) for b, end in zip(self.bent, self.ends, strict=True)]


def motor_after(p: dict[str, float], contacts: Contacts, q: float, v: float, net: float, torque: float, more: float, h):
    """The motor's next velocity under `net` and the torque in its transmission; `more` resists beside its friction."""
    bent = contacts.share() if contacts.travel > 0 else 0.0
    up = v > 0 if v != 0 else net > 0
    viscous = (p["viscous_positive"] if up else p["viscous_negative"]) * v
    if p["viscous_decline"] > 0:
        viscous /= 1 + abs(v) / p["viscous_decline"]
    viscous += p["square_root"] * math.copysign(math.sqrt(abs(v)), v)
    if contacts.travel > 0:
        slip = bent * dry(p, q, v, torque, bent >= 0)
        return v + h * (net - slip - viscous - more) / p["motor_inertia"]
    hold, slip = dry(p, q, 0.0, torque, net > 0), dry(p, q, v, torque, up)
    return after(v, net, hold, slip, viscous + more, p["motor_inertia"], h)


def simulate(
    parameters, *, reference, period, substeps=4, loop="none", kp=0.0, ki=0.0, kd=0.0, kv=0.0, limit=0.0,
    velocity_span=0, gain=1.0, back_emf=0.0, injected=None, disturbance=None, encoder_quantum=0.0, encoder_noise=None,
    ripple_amplitude=0.0, ripple_wave_number=0.0, ripple_phase=0.0, position0=0.0, velocity0=0.0, integral0=0.0,
):  # fmt: skip
    """The plant, sample by sample."""
    p = dict(zip(NAMES, parameters, strict=True))
    n = len(reference)
    injected, disturbance, encoder_noise = (
        np.zeros(n) if x is None else x for x in (injected, disturbance, encoder_noise)
    )
    controller = Loop(loop, period, kp, ki, kd, kv, limit, velocity_span)
    controller.integral = integral0
    h = period / substeps
    weight = gravity(p, position0)
    q, v, v_m = position0, velocity0, velocity0
    q_m = q + weight / p["stiffness"] + (math.copysign(0.5 * p["backlash"], weight) if weight else 0.0)
    contacts, rows = Contacts(p["presliding_travel"]), []
    for k in range(n):
        measured = round(q_m / encoder_quantum) * encoder_quantum if encoder_quantum > 0 else q_m
        measured += encoder_noise[k]
        u = controller.step(reference[k], measured, v_m) + injected[k]
        rows.append((q_m, v_m, q, v, u, measured, transmitted(p, q_m - q, v_m - v)))
        for _ in range(substeps):
            torque = transmitted(p, q_m - q, v_m - v)
            ripple = ripple_amplitude * math.sin(ripple_wave_number * q_m + ripple_phase)
            net = gain * u + ripple - torque
            next_motor = motor_after(p, contacts, q_m, v_m, net, torque, back_emf * v_m, h)
            net = torque + disturbance[k] - gravity(p, q)
            bearing = p["bearing_coulomb"]
            v = after(v, net, bearing, bearing, p["bearing_viscous"] * v, p["link_inertia"], h)
            v_m = next_motor
            contacts.move(h * v_m)
            q_m += h * v_m
            q += h * v
    return tuple(np.array(rows).T)
