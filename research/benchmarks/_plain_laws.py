"""The elbow's laws as a lab would write them in Python, step by step; `m` is ``math`` or ``numpy``."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

Values = Mapping[str, float]


class Gate:
    """Limits of torque, rate, velocity and position, and what is wrong with a sample; a fault latches."""

    def __init__(self, m, v: Values):
        self.m, self.v = m, v
        self.change = v["rate_limit"] * v["period"]
        self.oldest = int(v["max_age"] * 1e6)
        self.output, self.fault, self.last, self.repeats = 0.0, False, None, 0

    def wrong(self, wanted: float, position: float, velocity: float, time: int, number: int) -> bool:
        m, v = self.m, self.v
        if not (m.isfinite(wanted) and m.isfinite(position) and m.isfinite(velocity)):
            return True
        if self.last is not None:
            gap, ahead = time - self.last[0], number - self.last[1]
            if gap < 0 or ahead < 0:
                return True
            self.repeats = self.repeats + 1 if gap == 0 or ahead == 0 else 0
            if self.repeats > v["max_repeats"] or gap > self.oldest:
                return True
        self.last = time, number
        return abs(velocity) > v["velocity_limit"]

    def step(self, wanted: float, position: float, velocity: float, time: int, number: int) -> float:
        v, limit = self.v, self.v["effort_limit"]
        self.fault = self.fault or self.wrong(wanted, position, velocity, time, number)
        wanted = 0.0 if self.fault else min(max(wanted, -limit), limit)
        wanted = min(max(wanted, self.output - self.change), self.output + self.change)
        high = limit * min(max((v["position_max"] - position) / v["stop_margin"], 0.0), 1.0)
        low = -limit * min(max((position - v["position_min"]) / v["stop_margin"], 0.0), 1.0)
        self.output = min(max(wanted, low), high)
        return self.output


class Speed:
    """The encoder's difference over a few samples."""

    def __init__(self, v: Values):
        self.span, self.period, self.past = int(v["speed_span"]), v["period"], None

    def step(self, position: float) -> float:
        if self.past is None:
            self.past = deque([position] * self.span)
        oldest = self.past.popleft()
        self.past.append(position)
        return (position - oldest) / (self.span * self.period)


class PositionPrediction:
    """CLPC: sent each period to where it would be in one."""

    def __init__(self, m, v: Values):
        self.m, self.v, self.gate, self.speed, self.predicted = m, v, Gate(m, v), Speed(v), None

    def step(self, q: float, interaction: float, time: int, number: int) -> float:
        m, v = self.m, self.v
        speed = self.speed.step(q)
        u = v["gravity_sine"] * m.sin(q) + v["gravity_cosine"] * m.cos(q)
        if abs(speed) > v["dead_band"]:
            u += m.copysign(v["coulomb"], speed)
        if self.predicted is not None:
            u += v["stiffness"] * (self.predicted - q)
        self.predicted = q + v["period"] * speed
        return self.gate.step(u, q, speed, time, number)


class Directional:
    """FC and PCFr: gravity, friction and a term for inertia, by direction."""

    def __init__(self, m, v: Values):
        self.m, self.v, self.gate, self.speed = m, v, Gate(m, v), Speed(v)

    def step(self, q: float, interaction: float, time: int, number: int) -> float:
        m, v = self.m, self.v
        speed = self.speed.step(q)
        sine, cosine = m.sin(q), m.cos(q)
        if abs(speed) > v["dead_band"]:
            way = "up" if speed > 0.0 else "down"
            inertia = v[f"inertia_{way}"] * m.exp(v[f"exponent_{way}"] * m.log(abs(speed)))
            inertia = min(max(inertia, -v["inertia_limit"]), v["inertia_limit"])
            u = v[f"gravity_sine_{way}"] * sine + v[f"gravity_cosine_{way}"] * cosine + v[f"viscous_{way}"] * speed
            u += m.copysign(1.0, speed) * (v[f"coulomb_{way}"] + inertia)
        else:
            u = 0.5 * (v["gravity_sine_up"] + v["gravity_sine_down"]) * sine
            u += 0.5 * (v["gravity_cosine_up"] + v["gravity_cosine_down"]) * cosine
        return self.gate.step(u, q, speed, time, number)


class Transparent:
    """One coherent body: Kalman estimate, smooth friction, inertia, force feedback, energy observer."""

    def __init__(self, m, v: Values):
        self.m, self.v, self.gate = m, v, Gate(m, v)
        h, turn = v["period"], v["bandwidth"] * v["period"]
        real, radius = m.exp(-turn), m.exp(-0.5 * turn)
        pair = 2.0 * radius * m.cos(0.75**0.5 * turn)
        s1, s2, s3 = real + pair, real * pair + radius**2, real * radius**2
        alpha, gamma = 1.0 - s3, 2.0 * (s2 - s1 + 1.0 - s3)
        self.gains = alpha, (3.0 - s1 - alpha - 0.25 * gamma) / h, 0.5 * gamma / h**2
        self.smoothing, self.slow = 1.0 - m.exp(-v["sensor_lowpass"] * h), 1.0 - m.exp(-v["sensor_drift"] * h)
        self.forgetting = m.exp(-v["leak"] * h)
        self.motion, self.rejected = None, 0
        self.smooth, self.drift, self.integral, self.spent = None, 0.0, 0.0, 0.0

    def follow(self, q: float) -> tuple[float, float, float]:
        h = self.v["period"]
        if self.motion is None:
            self.motion = q, 0.0, 0.0
            return self.motion
        x, v, a = self.motion
        x, v = x + h * v + 0.5 * h * h * a, v + h * a
        off = q - x
        if abs(off) <= self.v["innovation_gate"]:
            self.rejected = 0
            x, v, a = x + self.gains[0] * off, v + self.gains[1] * off, a + self.gains[2] * off
        else:
            self.rejected += 1
            if self.rejected > self.v["max_rejections"]:
                self.motion, self.rejected = None, 0
                return 0.0, 0.0, 0.0
        self.motion = x, v, a
        return self.motion

    def friction(self, velocity: float, load: float) -> float:
        m, v = self.m, self.v
        s = m.tanh(velocity / v["velocity_width"])
        way = "positive" if s >= 0.0 else "negative"
        share = v["load_motoring"] if load * s > 0.0 else v["load_generating"]
        return v[f"coulomb_{way}"] * s + v[f"viscous_{way}"] * velocity + share * abs(load) * s

    def feedback(self, torque: float) -> float:
        v, limit = self.v, self.v["feedback_limit"]
        if self.smooth is None:
            self.smooth = torque
        self.smooth += self.smoothing * (torque - self.smooth)
        self.drift += self.slow * (self.smooth - self.drift)
        error = self.smooth - self.drift
        integral = self.forgetting * self.integral + v["integral"] * v["period"] * error
        self.integral = min(max(integral, -limit), limit)
        return min(max(v["proportional"] * error + self.integral, -limit), limit)

    def passed(self, torque: float, velocity: float, friction: float) -> float:
        if torque * velocity > 0.0 and self.spent >= self.v["energy_store"]:
            torque = 0.0
        self.spent = max(self.spent + self.v["period"] * (torque * velocity - abs(friction * velocity)), 0.0)
        return torque

    def step(self, q: float, interaction: float, time: int, number: int) -> float:
        m, v = self.m, self.v
        x, speed, a = self.follow(q)
        a = min(max(a, -v["acceleration_limit"]), v["acceleration_limit"])
        weight = v["gravity_sine"] * m.sin(x) + v["gravity_cosine"] * m.cos(x)
        moving = v["inertia_share"] * v["inertia"] * a
        drive = v["friction_share"] * self.friction(speed + v["friction_lead"] * a, weight + moving) + moving
        drive += self.feedback(interaction) if v["feedback_limit"] > 0.0 else 0.0
        u = v["gravity_share"] * weight + v["offset"] + self.passed(drive, speed, self.friction(speed, weight))
        return self.gate.step(u, q, speed, time, number)


PLAIN_LAWS = {"position_prediction": PositionPrediction, "directional": Directional, "transparent": Transparent}
"""The laws in plain Python, by the core's name of each law."""
