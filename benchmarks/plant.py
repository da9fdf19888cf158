"""How fast the plant runs: the core beside the same plant in Numba, and beside MuJoCo called from Python.

One joint with gravity, smooth Coulomb and viscous friction under a cascade loop at 1 kHz, 10 substeps a period, on one
core. What is compared runs interleaved in one process; figures are medians, with the spread of the repeats in the note.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable

import numpy as np

from pellucid import _core

PERIOD, SUBSTEPS, KP, KV, LIMIT = 1e-3, 10, 20.0, 3.0, 8.0
INERTIA, GRAVITY, COULOMB, VISCOUS, WIDTH = 0.05, 1.5, 0.3, 0.1, 0.02
ROWS = 64
REPEATS = 9

MUJOCO_MODEL = f"""
<mujoco>
  <option timestep="{PERIOD / SUBSTEPS}" integrator="Euler" gravity="0 0 -9.81">
    <flag contact="disable" eulerdamp="disable"/>
  </option>
  <worldbody>
    <body>
      <joint name="j" type="hinge" axis="0 1 0" damping="{VISCOUS}" frictionloss="{COULOMB}"/>
      <inertial pos="0 0 -0.1" mass="{GRAVITY / 0.981}" diaginertia="0.0347 0.0347 0.0347"/>
    </body>
  </worldbody>
  <actuator><motor joint="j"/></actuator>
</mujoco>
"""


def parameters() -> np.ndarray:
    values = dict.fromkeys(_core.PARAMETER_NAMES, 0.0) | {
        "inertia": INERTIA,
        "gravity_sine": GRAVITY,
        "coulomb_positive": COULOMB,
        "coulomb_negative": COULOMB,
        "viscous_positive": VISCOUS,
        "viscous_negative": VISCOUS,
        "velocity_width": WIDTH,
    }
    return np.array([values[name] for name in _core.PARAMETER_NAMES])


def reference(seconds: float) -> np.ndarray:
    t = PERIOD * np.arange(round(seconds / PERIOD))
    return np.sin(2 * t) + 0.3 * np.sin(13 * t)


def in_numba() -> tuple[Callable, Callable]:
    """The same plant, compiled by Numba as anyone would write it: one joint, and many one after another."""
    import numba

    @numba.njit
    def run(reference, inertia, gravity, coulomb, viscous, width, out):
        q = v = 0.0
        h = PERIOD / SUBSTEPS
        for k in range(reference.size):
            u = KV * (KP * (reference[k] - q) - v)
            u = min(max(u, -LIMIT), LIMIT)
            out[0, k], out[1, k], out[3, k], out[4, k], out[5, k] = q, v, u, u, q
            for i in range(SUBSTEPS):
                a = (u - coulomb * math.tanh(v / width) - viscous * v - gravity * math.sin(q)) / inertia
                if i == 0:
                    out[2, k] = a
                v += h * a
                q += h * v

    @numba.njit
    def run_many(reference, rows, out):
        for i in range(rows.shape[0]):
            run(reference, rows[i, 0], rows[i, 1], rows[i, 4], rows[i, 6], rows[i, 12], out[i])

    return run, run_many


def in_mujoco() -> Callable | None:
    """The same joint in MuJoCo, its loop in Python, ten steps a call; None where MuJoCo is not installed."""
    try:
        import mujoco
    except ImportError:
        return None
    model = mujoco.MjModel.from_xml_string(MUJOCO_MODEL)
    data = mujoco.MjData(model)

    def run(reference: np.ndarray) -> None:
        mujoco.mj_resetData(model, data)
        for r in reference.tolist():
            u = KV * (KP * (r - data.qpos[0]) - data.qvel[0])
            data.ctrl[0] = min(max(u, -LIMIT), LIMIT)
            mujoco.mj_step(model, data, SUBSTEPS)

    return run


def medians(cases: dict[str, tuple[float, Callable[[], object]]]) -> dict[str, tuple[float, float, float]]:
    """Simulated seconds per wall second of each case: median, lowest, highest; rounds of all cases."""
    rates: dict[str, list[float]] = {name: [] for name in cases}
    for name in cases:
        cases[name][1]()
    for _ in range(REPEATS):
        for name, (seconds, run) in cases.items():
            start = time.perf_counter()
            run()
            rates[name].append(seconds / (time.perf_counter() - start))
    return {name: (statistics.median(r), min(r), max(r)) for name, r in rates.items()}


def run() -> list[dict]:
    p = parameters()
    rows = np.tile(p, (ROWS, 1)) * (1 + 0.1 * np.random.default_rng(1).random((ROWS, 13)))
    long, short = reference(20.0), reference(2.0)
    loop = dict(period=PERIOD, substeps=SUBSTEPS, loop="cascade", kp=KP, kv=KV, limit=LIMIT)
    cases: dict[str, tuple[float, Callable[[], object]]] = {
        "core": (20.0, lambda: _core.simulate(p, reference=long, **loop)),
        "core batch": (2.0 * ROWS, lambda: _core.simulate_batch(rows, reference=short, **loop)),
        "core stiction": (20.0, lambda: _core.simulate(p, reference=long, stiction=True, **loop)),
    }
    one, many = in_numba()
    out, outs = np.empty((6, long.size)), np.empty((ROWS, 6, short.size))
    arguments = (INERTIA, GRAVITY, COULOMB, VISCOUS, WIDTH)
    cases["numba"] = (20.0, lambda: one(long, *arguments, out))
    cases["numba batch"] = (2.0 * ROWS, lambda: many(short, rows, outs))
    one(long, *arguments, out)
    np.testing.assert_allclose(out, _core.simulate(p, reference=long, **loop), rtol=1e-6, atol=1e-6)
    mujoco = in_mujoco()
    if mujoco is not None:
        cases["mujoco"] = (2.0, lambda: mujoco(short))

    rate = medians(cases)
    about = f"1 kHz loop, {1e-3 * SUBSTEPS / PERIOD:.0f} kHz substeps, one core, {_core.instructions}"
    notes = {
        "core": about,
        "core batch": f"{about}, {ROWS} joints in lanes",
        "core stiction": f"{about}, true stiction",
        "numba": "the same equations, one joint",
        "numba batch": f"the same equations, {ROWS} joints one after another",
        "mujoco": "the same joint (frictionloss for tanh), loop in Python, 10 steps a call",
    }
    rows_out = [
        {
            "name": f"plant.{name.replace(' ', '_')}",
            "value": rate[name][0],
            "unit": "s/s",
            "note": f"{notes[name]}; median of {REPEATS}, {rate[name][1]:.0f} to {rate[name][2]:.0f}",
        }
        for name in rate
    ]
    pairs = [("core", "numba"), ("core batch", "numba batch"), ("core", "mujoco"), ("core batch", "mujoco")]
    rows_out += [
        {
            "name": f"plant.{a.replace(' ', '_')}_over_{b.replace(' ', '_')}",
            "value": rate[a][0] / rate[b][0],
            "unit": "1",
            "note": "ratio of the medians of one run",
        }
        for a, b in pairs
        if b in rate
    ]
    return rows_out


if __name__ == "__main__":
    for row in run():
        print(f"{row['name']:40s} {row['value']:12.4g} {row['unit']:5s} {row['note']}")
