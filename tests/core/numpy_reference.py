"""The core's models written again, plainly, in NumPy and Python floats: what the tests compare it with."""

from __future__ import annotations

import math

import numpy as np

NAMES = (
    "inertia", "gravity_sine", "gravity_cosine", "offset", "coulomb_positive", "coulomb_negative", "viscous_positive",
    "viscous_negative", "stribeck", "stribeck_velocity", "load_motoring", "load_generating", "square_root",
    "velocity_width", "parallel_stiffness",
)  # fmt: skip

EXAMPLE = dict(
    inertia=0.05, gravity_sine=1.5, gravity_cosine=-0.2, offset=0.05, coulomb_positive=0.3, coulomb_negative=0.25,
    viscous_positive=0.1, viscous_negative=0.15, stribeck=0.12, stribeck_velocity=0.1, load_motoring=0.08,
    load_generating=0.15, square_root=0.07, velocity_width=0.05, parallel_stiffness=0.0,
)  # fmt: skip


def parameters(**changes: float) -> np.ndarray:
    """The example joint with some parameters changed, in the core's order."""
    values = EXAMPLE | changes
    assert set(values) == set(NAMES)
    return np.array([values[name] for name in NAMES])


def random_parameters(rng: np.random.Generator, **fixed: float) -> np.ndarray:
    ranges = dict(
        inertia=(0.02, 1), gravity_sine=(-10, 10), gravity_cosine=(-3, 3), offset=(-1, 1), coulomb_positive=(0, 3),
        coulomb_negative=(0, 3), viscous_positive=(0, 2), viscous_negative=(0, 2), stribeck=(0, 1),
        stribeck_velocity=(0.02, 0.5), load_motoring=(0, 0.4), load_generating=(0, 0.6), velocity_width=(0.02, 0.2),
        square_root=(0, 0.5), parallel_stiffness=(-1, 4),
    )  # fmt: skip
    return parameters(**{name: rng.uniform(*range_) for name, range_ in ranges.items()} | fixed)


def direction_of(p: dict[str, float], v: float) -> float:
    return math.tanh(v / p["velocity_width"]) if p["velocity_width"] > 0 else float(np.sign(v))


def root_of(v: float, width: float) -> float:
    """sqrt|v| with v's sign, smooth over a width."""
    return v / (v * v + width * width) ** 0.25 if width > 0 else math.copysign(math.sqrt(abs(v)), v)


def level(p: dict[str, float], v: float, up: bool) -> float:
    value = p["coulomb_positive"] if up else p["coulomb_negative"]
    if p["stribeck_velocity"] > 0:
        value += p["stribeck"] * math.exp(-((v / p["stribeck_velocity"]) ** 2))
    return value


def friction(parameters: np.ndarray, velocity: np.ndarray, load: np.ndarray) -> np.ndarray:
    p = dict(zip(NAMES, parameters, strict=True))
    result = []
    for v, y in zip(velocity, load, strict=True):
        s = direction_of(p, v)
        alpha = p["load_motoring"] if y * v > 0 else p["load_generating"]
        viscous = p["viscous_positive"] if v > 0 else p["viscous_negative"]
        root = root_of(v, p["velocity_width"])
        result.append(level(p, v, v > 0) * s + viscous * v + p["square_root"] * root + alpha * abs(y) * s)
    return np.array(result)


def load(parameters: np.ndarray, position: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    p = dict(zip(NAMES, parameters, strict=True))
    weight = p["gravity_sine"] * np.sin(position) + p["gravity_cosine"] * np.cos(position)
    return p["inertia"] * acceleration + weight + p["parallel_stiffness"] * position


def inverse_dynamics(parameters, position, velocity, acceleration) -> np.ndarray:
    y = load(parameters, position, acceleration)
    return y + friction(parameters, velocity, y) + parameters[3]


def forward_dynamics(parameters, position, velocity, effort) -> np.ndarray:
    """Acceleration by bisection on inverse_dynamics, which is monotonic in it: no closed form, so no shared mistake."""
    result = []
    for q, v, t in zip(position, velocity, effort, strict=True):
        low, high = -1e6, 1e6
        for _ in range(200):
            middle = 0.5 * (low + high)
            reached = inverse_dynamics(parameters, np.array([q]), np.array([v]), np.array([middle]))[0]
            low, high = (middle, high) if reached < t else (low, middle)
        result.append(0.5 * (low + high))
    return np.array(result)


class Presliding:
    """Springs with sliders side by side, each in its own unit of way; s of their parabola at its chords."""

    COUNT = 8

    def __init__(self, travel: float):
        self.ends = travel * np.arange(1, self.COUNT + 1) / self.COUNT
        slopes = 2 - (2 * np.arange(1, self.COUNT + 1) - 1) / self.COUNT  # of the chords, per travel
        self.stiffness = -np.diff(slopes, append=0.0) / travel
        self.bent = np.zeros(self.COUNT)

    def step(self, way: float) -> float:
        self.bent = np.clip(self.bent + way, -self.ends, self.ends)
        return float(self.stiffness @ self.bent)


def lugre(position: np.ndarray, length: float) -> np.ndarray:
    """The other usual model's bristle, per level, along a way: s' = (v - |v| s) / length, length F_c / sigma_0."""
    s, result = 0.0, [0.0]
    for way in np.diff(position):  # exact along a way without a turn
        s = np.sign(way) + (s - np.sign(way)) * math.exp(-abs(way) / length)
        result.append(s)
    return np.array(result)


class Loop:
    def __init__(self, kind, period, kp=0.0, ki=0.0, kd=0.0, kv=0.0, limit=0.0, velocity_span=0):
        self.kind, self.period, self.span = kind, period, velocity_span
        self.kp, self.ki, self.kd, self.kv, self.limit = kp, ki, kd, kv, limit
        self.positions: list[float] = []
        self.references: list[float] = []
        self.integral = 0.0

    def difference(self, values: list[float], span: int) -> float:
        past = values[max(len(values) - 1 - span, 0)]
        return (values[-1] - past) / (span * self.period)

    def step(self, r: float, q: float, true_velocity: float) -> float:
        self.positions.append(q)
        self.references.append(r)
        v = self.difference(self.positions, self.span) if self.span else true_velocity
        if self.kind == "none":
            return self.saturate(r)
        extra, ki, gain = 0.0, self.ki, self.kp
        if self.kind == "cascade":
            error, gain = self.kp * (r - q) - v, self.kv
        elif self.kind == "velocity_pi":
            error = r - v
        else:
            error = r - q
        if self.kind in ("p", "pd"):
            ki = 0.0
        if self.kind == "pd":
            extra = self.kd * (self.difference(self.references, max(self.span, 1)) - v)
        summed = self.integral + error * self.period
        wanted = gain * error + extra + ki * summed
        if not (self.limit > 0 and abs(wanted) > self.limit and ki * error * wanted > 0):
            self.integral = summed
        return self.saturate(gain * error + extra + ki * self.integral)

    def saturate(self, u: float) -> float:
        return min(max(u, -self.limit), self.limit) if self.limit > 0 else u


def simulate(
    parameters, *, reference, period, substeps=4, loop="none", kp=0.0, ki=0.0, kd=0.0, kv=0.0, limit=0.0,
    velocity_span=0, gain=1.0, back_emf=0.0, injected=None, disturbance=None, encoder_quantum=0.0, encoder_noise=None,
    ripple_amplitude=0.0, ripple_wave_number=0.0, ripple_phase=0.0, position0=0.0, velocity0=0.0, stiction=False,
    presliding_travel=0.0,
):  # fmt: skip
    """The plant, sample by sample."""
    p = dict(zip(NAMES, parameters, strict=True))
    n = len(reference)
    injected, disturbance, encoder_noise = (
        np.zeros(n) if x is None else x for x in (injected, disturbance, encoder_noise)
    )
    controller = Loop(loop, period, kp, ki, kd, kv, limit, velocity_span)
    q, v = position0, velocity0
    rows = []
    contact, bent = Presliding(presliding_travel) if presliding_travel > 0 else None, 0.0
    for k in range(n):
        measured = round(q / encoder_quantum) * encoder_quantum if encoder_quantum > 0 else q
        measured += encoder_noise[k]
        u = controller.step(reference[k], measured, v) + injected[k]
        row = [q, v, None, u, gain * u - back_emf * v, measured]
        for i in range(substeps):
            outside = ripple_amplitude * math.sin(ripple_wave_number * q + ripple_phase) + disturbance[k]
            gravity = p["gravity_sine"] * math.sin(q) + p["gravity_cosine"] * math.cos(q)
            gravity += p["parallel_stiffness"] * q
            effort = gain * u - back_emf * v + outside
            net = gain * u + outside - p["offset"] - gravity
            if contact:
                s, held = bent, False
            elif stiction:
                s = float(np.sign(v if v != 0 else net))
                along = net * gravity > 0
                alpha = p["load_motoring"] if along else p["load_generating"]
                held = abs(net) <= level(p, 0.0, net >= 0) + alpha * abs(gravity)
            else:
                s, held = direction_of(p, v), False
            viscous = p["viscous_negative"] if (v if contact else s) < 0 else p["viscous_positive"]
            root = root_of(v, 0.0 if contact or stiction else p["velocity_width"])
            left = effort - p["offset"] - level(p, v, s >= 0) * s - viscous * v - p["square_root"] * root
            share = 1 + p["load_motoring"] * abs(s) if left * s > 0 else 1 - p["load_generating"] * abs(s)
            a = (left / share - gravity) / p["inertia"]
            if held and v == 0:
                a = 0.0
            if i == 0:
                row[2] = a
            after = v + period / substeps * a
            v = 0.0 if held and not v * after > 0 else after
            q += period / substeps * v
            bent = contact.step(period / substeps * v) if contact else 0.0
        rows.append(row)
    return tuple(np.array(rows).T)
