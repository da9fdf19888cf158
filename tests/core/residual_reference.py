"""The residual compensator in plain NumPy, from docs/explanation/residual-compensation.md, to compare the core with."""

import numpy as np


class Reference:
    """Without the gate: the torque that the law wants, and the observer behind it."""

    def __init__(self, **values):
        self.v = values
        self.x = np.zeros(5)  # q_e, v_e, D, dD, d
        self.integral = self.slow = self.trust = 0.0
        self.started = False

    def step(self, position, torque, emg):
        v = self.v
        period = v["period"]
        heard = np.isfinite(emg)
        self.trust += np.clip(float(heard) - self.trust, -period / v["trust_time"], period / v["trust_time"])
        muscle = float(np.clip(emg, -v["emg_limit"], v["emg_limit"])) if heard else 0.0
        if not self.started:
            self.x[0] = position
            self.started = True
        names = ("position", "velocity", "mismatch", "mismatch_rate", "disturbance")
        gains = np.array([v[f"correct_{name}"] for name in names])
        self.x = self.x + gains * np.clip(position - self.x[0], -v["innovation_limit"], v["innovation_limit"])
        self.x[4] = np.clip(self.x[4], -v["emg_limit"], v["emg_limit"])
        q, w, d, r, missing = self.x
        spring = v["strap_stiffness"] * (np.sign(d) * max(abs(d) - v["slack"], 0.0))
        strap = spring + v["strap_damping"] * r
        rub = v["orthosis_viscous"] * w + v["coulomb"] * np.tanh(w / v["friction_width"])
        a_e = (torque + strap - rub - v["orthosis_gravity"] * np.sin(q)) / v["orthosis_inertia"]
        drop = v["limb_viscous"] * (w + r) + v["limb_gravity"] * np.sin(q + d)
        a_k = (muscle + missing - strap - drop) / v["limb_inertia"]

        h, t = v["preview"], self.trust
        ahead = (1 - t) * w + t * (w + r + h * a_k)
        sign = np.tanh(ahead / v["assist_width"])
        lift = v["gravity_share"] * v["orthosis_gravity"] * np.sin(q + h * w)

        def drag(viscous, coulomb, inertia):
            return (
                v["viscous_share"] * viscous * ahead
                + v["friction_share"] * coulomb * sign
                + t * v["inertia_share"] * inertia * a_k
            )

        self.integral += v["integral"] * period * strap
        self.integral = np.clip(self.integral, -v["integral_limit"], v["integral_limit"])
        rate = v["strap_stiffness"] * r + v["strap_damping"] * (a_k - a_e)
        wanted = lift + drag(v["orthosis_viscous"], v["coulomb"], v["orthosis_inertia"])
        wanted += v["proportional"] * strap + self.integral + v["derivative"] * rate
        through = drag(v["actuator_viscous"], v["actuator_coulomb"], v["actuator_inertia"])
        self.slow += v["actuator_leak"] * period * (through - self.slow)
        command = wanted + through - self.slow + v["torque_gain"] * (wanted - torque)

        # The gain at this place of the swing, on the circle that a diamond stands for.
        x, y = q - v["swing_angle"], w / v["swing_rate"]
        if abs(x) + abs(y) > 0:
            side = (1 - x / (abs(x) + abs(y))) if y >= 0 else 3 + x / (abs(x) + abs(y))
            place = 2 * side
        else:
            place = 0.0
        gains = [v[f"phase_gain_{i}"] for i in range(8)]
        command *= float(np.interp(place, np.arange(9), [*gains, gains[0]]))

        w += period * a_e
        r += period * (a_k - a_e)
        self.x = np.array([q + period * w, w, d + period * r, r, missing])
        return command
