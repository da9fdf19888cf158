"""Speed of the plant: the core, the same plant in Numba, and MuJoCo called from Python.

One joint with gravity, smooth Coulomb and viscous friction under a cascade loop at 1 kHz, 10 substeps a period, on one
core. Then a motor and a link behind a compliant transmission with backlash, 4 substeps, with all terms of its friction.
Compared runs are interleaved in one process; figures are medians, with the spread of the repeats in the note.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable

import numpy as np

from pellucid import _core

from ._peers import peer
from ._size import sized

PERIOD_S = 1e-3
"""Control period [s]."""

SUBSTEP_COUNT = 10
"""Number of simulation steps in a control period."""

POSITION_GAIN = 20.0
"""Gain of the position loop [1/s]."""

VELOCITY_GAIN = 3.0
"""Gain of the velocity loop [N*m*s/rad]."""

EFFORT_LIMIT_NM = 8.0
"""Largest effort of the drive [N*m]."""

INERTIA_KGM2 = 0.05
"""Inertia of the joint [kg*m^2]."""

GRAVITY_NM = 1.5
"""Largest gravity torque of the joint [N*m]."""

COULOMB_NM = 0.3
"""Coulomb friction of the joint [N*m]."""

VISCOUS_NMS = 0.1
"""Viscous friction of the joint [N*m*s/rad]."""

SIGN_WIDTH_RAD_S = 0.02
"""Velocity over which the sign of friction changes [rad/s]."""

ROW_COUNT = sized(64, smallest=8)
"""Number of joints that are simulated at once."""

GEARED_ROW_COUNT = sized(60, smallest=8)
"""Number of geared joints that are simulated at once."""

GEARED_SUBSTEP_COUNT = 4
"""Number of simulation steps of the geared joint in a control period."""

GEARED_POSITION_GAIN = 20.0
"""Gain of the geared joint's position loop [1/s]."""

GEARED_VELOCITY_GAIN = 8.0
"""Gain of the geared joint's velocity loop [N*m*s/rad]."""

GEARED_EFFORT_LIMIT_NM = 30.0
"""Largest effort of the geared joint's drive [N*m]."""

GEARED_JOINT = {
    "link_inertia": 0.15,
    "gravity_sine": 8.0,
    "gravity_cosine": -0.5,
    "motor_inertia": 0.08,
    "stiffness": 900.0,
    "damping": 1.5,
    "backlash": 0.004,
    "coulomb_positive": 0.6,
    "coulomb_negative": 0.5,
    "viscous_positive": 0.4,
    "viscous_negative": 0.5,
    "stribeck": 0.3,
    "stribeck_velocity": 0.1,
    "load_motoring": 0.08,
    "load_generating": 0.15,
    "square_root": 0.0,
    "load_rise": 0.5,
    "friction_swing": 0.15,
    "friction_wave_number": 6.0,
    "viscous_decline": 3.0,
    "presliding_travel": 0.0,
    "bearing_coulomb": 0.05,
    "bearing_viscous": 0.02,
}
"""Parameters of the geared joint, SI."""

RIPPLE_AMPLITUDE = 0.05
"""Amplitude of the ripple of the drive's torque [N*m]."""

RIPPLE_WAVE_NUMBER = 14.0
"""Wave number of the ripple over the motor's angle [1/rad]."""

REPEAT_COUNT = sized(9, smallest=1)
"""Number of timed runs."""

MUJOCO_MODEL = f"""
<mujoco>
  <option timestep="{PERIOD_S / SUBSTEP_COUNT}" integrator="Euler" gravity="0 0 -9.81">
    <flag contact="disable" eulerdamp="disable"/>
  </option>
  <worldbody>
    <body>
      <joint name="j" type="hinge" axis="0 1 0" damping="{VISCOUS_NMS}" frictionloss="{COULOMB_NM}"/>
      <inertial pos="0 0 -0.1" mass="{GRAVITY_NM / 0.981}" diaginertia="0.0347 0.0347 0.0347"/>
    </body>
  </worldbody>
  <actuator><motor joint="j"/></actuator>
</mujoco>
"""


def parameters() -> np.ndarray:
    values = dict.fromkeys(_core.PARAMETER_NAMES, 0.0) | {
        "inertia": INERTIA_KGM2,
        "gravity_sine": GRAVITY_NM,
        "coulomb_positive": COULOMB_NM,
        "coulomb_negative": COULOMB_NM,
        "viscous_positive": VISCOUS_NMS,
        "viscous_negative": VISCOUS_NMS,
        "velocity_width": SIGN_WIDTH_RAD_S,
    }
    return np.array([values[name] for name in _core.PARAMETER_NAMES])


def reference(seconds: float) -> np.ndarray:
    t = PERIOD_S * np.arange(round(seconds / PERIOD_S))
    return np.sin(2 * t) + 0.3 * np.sin(13 * t)


def in_numba() -> tuple[Callable, Callable] | None:
    """The same plant, compiled by Numba as anyone would write it: one joint, and many one after another; None where
    Numba is not installed."""
    numba = peer("plant", "numba")
    if numba is None:
        return None

    @numba.njit
    def run(reference, inertia, gravity, coulomb, viscous, width, out):
        q = v = 0.0
        h = PERIOD_S / SUBSTEP_COUNT
        for k in range(reference.size):
            u = VELOCITY_GAIN * (POSITION_GAIN * (reference[k] - q) - v)
            u = min(max(u, -EFFORT_LIMIT_NM), EFFORT_LIMIT_NM)
            out[0, k], out[1, k], out[3, k], out[4, k], out[5, k] = q, v, u, u, q
            for i in range(SUBSTEP_COUNT):
                a = (u - coulomb * math.tanh(v / width) - viscous * v - gravity * math.sin(q)) / inertia
                if i == 0:
                    out[2, k] = a
                v += h * a
                q += h * v

    @numba.njit
    def run_many(reference, rows, out):
        for i in range(rows.shape[0]):
            run(reference, rows[i, 0], rows[i, 1], rows[i, 4], rows[i, 6], rows[i, 13], out[i])

    return run, run_many


def geared_in_numba() -> Callable | None:
    """The geared plant as `_core.simulate_geared` runs it, compiled by Numba, one row after another; None where Numba
    is not installed."""
    numba = peer("plant", "numba")
    if numba is None:
        return None

    @numba.njit
    def dry(swung, rise, torque, up, p):
        motoring = torque > 0 if up else torque < 0
        alpha = p[13] if motoring else p[14]
        return (p[7] if up else p[8]) * swung + p[11] * rise + alpha * (1 + p[16] * rise) * abs(torque)

    @numba.njit
    def moved(v, net, hold, slip, viscous, inertia, h):
        held = abs(net) <= hold
        if v == 0.0:
            return 0.0 if held else h * (net - math.copysign(slip, net)) / inertia
        after = v + h * (net - math.copysign(slip, v) - viscous) / inertia
        return 0.0 if held and after * v <= 0 else after

    @numba.njit
    def torque_of(twist, rate, p):
        half = 0.5 * p[6]
        if twist > half:
            return max(p[4] * (twist - half) + p[5] * rate, 0.0)
        if twist < -half:
            return min(p[4] * (twist + half) + p[5] * rate, 0.0)
        return 0.0

    @numba.njit
    def run(reference, rows, out):
        h = PERIOD_S / GEARED_SUBSTEP_COUNT
        for i in range(rows.shape[0]):
            p = rows[i]
            q = v = v_m = 0.0
            weight = p[2]
            q_m = weight / p[4] + (math.copysign(0.5 * p[6], weight) if weight != 0 else 0.0)
            for k in range(reference.size):
                u = GEARED_VELOCITY_GAIN * (GEARED_POSITION_GAIN * (reference[k] - q_m) - v_m)
                u = min(max(u, -GEARED_EFFORT_LIMIT_NM), GEARED_EFFORT_LIMIT_NM)
                out[0, i, k], out[1, i, k], out[2, i, k], out[3, i, k] = q_m, v_m, q, v
                out[4, i, k], out[5, i, k], out[6, i, k] = u, q_m, torque_of(q_m - q, v_m - v, p)
                for _ in range(GEARED_SUBSTEP_COUNT):
                    torque = torque_of(q_m - q, v_m - v, p)
                    net = u + RIPPLE_AMPLITUDE * math.sin(RIPPLE_WAVE_NUMBER * q_m) - torque
                    up = v_m > 0 if v_m != 0 else net > 0
                    swung = 1 + p[17] * math.sin(p[18] * q_m)
                    hold = dry(swung, 1.0, torque, net > 0, p)
                    slip = dry(swung, math.exp(-((v_m / p[12]) ** 2)), torque, up, p)
                    viscous = (p[9] if up else p[10]) * v_m / (1 + abs(v_m) / p[19])
                    turned = moved(v_m, net, hold, slip, viscous, p[3], h)
                    net = torque - p[1] * math.sin(q) - p[2] * math.cos(q)
                    v = moved(v, net, p[21], p[21], p[22] * v, p[0], h)
                    v_m = turned
                    q_m += h * v_m
                    q += h * v

    return run


def geared_cases() -> dict[str, tuple[float, Callable[[], object]]]:
    """The geared plant: one row, many, on one thread and on two, and where it is installed in Numba; checked to be the
    same motion."""
    r = reference(5.0)
    rows = np.tile([GEARED_JOINT[name] for name in _core.GEARED_PARAMETER_NAMES], (GEARED_ROW_COUNT, 1))
    rows[:, :2] *= np.linspace(0.7, 1.3, GEARED_ROW_COUNT)[:, None]  # a slider: inertia and gravity of the link
    settings = dict(
        reference=r, period=PERIOD_S, substeps=GEARED_SUBSTEP_COUNT, loop="cascade", kp=GEARED_POSITION_GAIN,
        kv=GEARED_VELOCITY_GAIN,
        limit=GEARED_EFFORT_LIMIT_NM, ripple_amplitude=RIPPLE_AMPLITUDE, ripple_wave_number=RIPPLE_WAVE_NUMBER,
    )  # fmt: skip
    cases = {
        "geared": (5.0, lambda: _core.simulate_geared(rows[:1], **settings)),
        "geared batch": (5.0 * GEARED_ROW_COUNT, lambda: _core.simulate_geared(rows, **settings)),
        "geared batch threads": (5.0 * GEARED_ROW_COUNT, lambda: _core.simulate_geared(rows, threads=2, **settings)),
    }
    run = geared_in_numba()
    if run is None:
        return cases
    out, outs = np.empty((7, 1, r.size)), np.empty((7, GEARED_ROW_COUNT, r.size))
    run(r, rows[:1], out)
    for got, wanted in zip(_core.simulate_geared(rows[:1], **settings), out, strict=True):
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-6 * np.max(np.abs(wanted)))
    return {
        **cases,
        "geared numba": (5.0, lambda: run(r, rows[:1], out)),
        "geared numba batch": (5.0 * GEARED_ROW_COUNT, lambda: run(r, rows, outs)),
    }


def in_mujoco() -> Callable | None:
    """The same joint in MuJoCo, its loop in Python, ten steps a call; None where MuJoCo is not installed."""
    mujoco = peer("plant", "mujoco")
    if mujoco is None:
        return None
    model = mujoco.MjModel.from_xml_string(MUJOCO_MODEL)
    data = mujoco.MjData(model)

    def run(reference: np.ndarray) -> None:
        mujoco.mj_resetData(model, data)
        for r in reference.tolist():
            u = VELOCITY_GAIN * (POSITION_GAIN * (r - data.qpos[0]) - data.qvel[0])
            data.ctrl[0] = min(max(u, -EFFORT_LIMIT_NM), EFFORT_LIMIT_NM)
            mujoco.mj_step(model, data, SUBSTEP_COUNT)

    return run


def medians(cases: dict[str, tuple[float, Callable[[], object]]]) -> dict[str, tuple[float, float, float]]:
    """Simulated seconds per wall second of each case: median, lowest, highest; rounds of all cases."""
    rates: dict[str, list[float]] = {name: [] for name in cases}
    for name in cases:
        cases[name][1]()
    for _ in range(REPEAT_COUNT):
        for name, (seconds, run) in cases.items():
            start = time.perf_counter()
            run()
            rates[name].append(seconds / (time.perf_counter() - start))
    return {name: (statistics.median(r), min(r), max(r)) for name, r in rates.items()}


def run() -> list[dict]:
    p = parameters()
    rows = np.tile(p, (ROW_COUNT, 1)) * (1 + 0.1 * np.random.default_rng(1).random((ROW_COUNT, len(p))))
    long, short = reference(20.0), reference(2.0)
    loop = dict(
        period=PERIOD_S,
        substeps=SUBSTEP_COUNT,
        loop="cascade",
        kp=POSITION_GAIN,
        kv=VELOCITY_GAIN,
        limit=EFFORT_LIMIT_NM,
    )
    cases: dict[str, tuple[float, Callable[[], object]]] = {
        "core": (20.0, lambda: _core.simulate(p, reference=long, **loop)),
        "core batch": (2.0 * ROW_COUNT, lambda: _core.simulate_batch(rows, reference=short, **loop)),
        "core stiction": (20.0, lambda: _core.simulate(p, reference=long, stiction=True, **loop)),
    }
    compiled = in_numba()
    if compiled is not None:
        one, many = compiled
        out, outs = np.empty((6, long.size)), np.empty((ROW_COUNT, 6, short.size))
        arguments = (INERTIA_KGM2, GRAVITY_NM, COULOMB_NM, VISCOUS_NMS, SIGN_WIDTH_RAD_S)
        cases["numba"] = (20.0, lambda: one(long, *arguments, out))
        cases["numba batch"] = (2.0 * ROW_COUNT, lambda: many(short, rows, outs))
        one(long, *arguments, out)
        np.testing.assert_allclose(out, _core.simulate(p, reference=long, **loop), rtol=1e-6, atol=1e-6)
    mujoco = in_mujoco()
    if mujoco is not None:
        cases["mujoco"] = (2.0, lambda: mujoco(short))
    cases |= geared_cases()

    rate = medians(cases)
    geared = (
        f"motor, transmission and link, {1e-3 * GEARED_SUBSTEP_COUNT / PERIOD_S:.0f} kHz substeps, {_core.instructions}"
    )
    about = f"1 kHz loop, {1e-3 * SUBSTEP_COUNT / PERIOD_S:.0f} kHz substeps, one core, {_core.instructions}"
    notes = {
        "core": about,
        "core batch": f"{about}, {ROW_COUNT} joints in lanes",
        "core stiction": f"{about}, true stiction",
        "numba": "the same equations, one joint",
        "numba batch": f"the same equations, {ROW_COUNT} joints one after another",
        "mujoco": "the same joint (frictionloss for tanh), loop in Python, 10 steps a call",
        "geared": f"{geared}, one core",
        "geared batch": f"{geared}, one core, {GEARED_ROW_COUNT} rows in lanes",
        "geared batch threads": f"{geared}, two threads, {GEARED_ROW_COUNT} rows in lanes",
        "geared numba": "the same equations, one row",
        "geared numba batch": f"the same equations, {GEARED_ROW_COUNT} rows one after another",
    }
    rows_out = [
        {
            "name": f"plant.{name.replace(' ', '_')}",
            "value": rate[name][0],
            "unit": "s/s",
            "note": f"{notes[name]}; median of {REPEAT_COUNT}, {rate[name][1]:.0f} to {rate[name][2]:.0f}",
        }
        for name in rate
    ]
    pairs = [("core", "numba"), ("core batch", "numba batch"), ("core", "mujoco"), ("core batch", "mujoco")]
    pairs += [("geared", "geared numba"), ("geared batch", "geared numba batch")]
    rows_out += [
        {
            "name": f"plant.{a.replace(' ', '_')}_over_{b.replace(' ', '_')}",
            "value": rate[a][0] / rate[b][0],
            "unit": "1",
            "note": "ratio of the medians of one run",
        }
        for a, b in pairs
        if a in rate and b in rate
    ]
    return rows_out


if __name__ == "__main__":
    for row in run():
        print(f"{row['name']:40s} {row['value']:12.4g} {row['unit']:5s} {row['note']}")
