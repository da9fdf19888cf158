"""Bounds of motion or observed torque without a force sensor: required thresholds and remaining energy of faults.

Without a force sensor the motion shows only the sum of the wearer's and the drive's torque. Each bound here is a
quantity that grows while a joint oscillates. Its threshold is the largest value of healthy wearers. The remaining
energy is that of an added sine on the wearer until the quantity exceeds the threshold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.signal import lfilter

from research.benchmarks._size import sized

from .exports import ExportedLaw
from .foreign_people import TRACE_FIELDS, draw_run, with_mishaps
from .trials import fault_runs, play, play_all

LIFE_S = sized(300.0, smallest=20.0)
"""Duration of one healthy life whose needs are measured."""

PLANT_COUNT = sized(20, smallest=1)
"""Number of plants and wearers whose needs are measured under every law."""

MEMORIES_S = (10.0, 3.0, 1.0)
"""Times in which a bounded number forgets."""

RECENT_HZ = 10.0
"""Rate at which means of either direction follow [1/s]."""

OBSERVER_HZ = 40.0
"""Rate of the momentum observer, as in the supervisor [1/s]."""

BAR_J = 5.0
"""Energy that an added sine should not exceed."""


@dataclass(frozen=True)
class SeenMotion:
    """What the controller sees of one run in every second period while its law is in force."""

    step: float  # time between two rows [s]
    velocity: np.ndarray  # shape (t,) [rad/s]
    torque: np.ndarray  # torque that model and command do not explain, shape (t,) [N m]
    fault: np.ndarray  # whether the fault is there, shape (t,)
    surplus: np.ndarray  # largest surplus of work on the limb so far, shape (t,) [J]


def seen_motion(law: ExportedLaw, trace: np.ndarray, period: float) -> SeenMotion:
    """Return what the controller sees of a run, by the momentum observer with the body of the law's supervisor."""
    columns = dict(zip(TRACE_FIELDS, trace.T, strict=True))
    step, body = 2.0 * period, {name[5:]: x for name, x in law.numbers.items() if name.startswith("body_")}
    position = columns["position"]
    velocity = np.diff(position, prepend=position[0]) / step
    weight = body["gravity_sine"] * np.sin(position) + body["gravity_cosine"] * np.cos(position) + body["offset"]
    level = body["coulomb"] + body["load"] * np.abs(weight)
    friction = level * np.clip(velocity / body["width"], -1.0, 1.0) + body["viscous"] * velocity
    friction += body["square_root"] * np.sign(velocity) * np.sqrt(np.abs(velocity))
    change = body["inertia"] * np.diff(velocity, prepend=velocity[0]) - step * (columns["effort"] - weight - friction)
    torque = follow(change / step, OBSERVER_HZ, step)
    kept = columns["in_force"] > 0.0
    surplus = np.maximum.accumulate(columns["surplus"])
    return SeenMotion(step, velocity[kept], torque[kept], columns["since"][kept] >= 0.0, surplus[kept])


def follow(values: np.ndarray, rate: float, step: float) -> np.ndarray:
    """Return values behind a lag of first order with a `rate` [1/s], shape (t,)."""
    share = rate * step
    return lfilter([share], [1.0, share - 1.0], values)


def forget(powers: np.ndarray, memory: float, step: float) -> np.ndarray:
    """Return the integral of values that is forgotten with the time constant `memory` [s], shape (t,)."""
    return lfilter([step], [1.0, step / memory - 1.0], powers)


def to_and_fro(values: np.ndarray, step: float) -> np.ndarray:
    """Return the smaller of the recent means of both signs of values, shape (t,)."""
    both = (follow(np.maximum(way * values, 0.0), RECENT_HZ, step) for way in (1.0, -1.0))
    return np.minimum(*both)


BOUNDED: Mapping[str, tuple[str, Callable[[SeenMotion], np.ndarray]]] = {
    "energy that the wearer seems to give": ("J", lambda m: np.maximum(m.torque * m.velocity, 0.0)),
    "energy that the wearer seems to absorb": ("J", lambda m: np.maximum(-m.torque * m.velocity, 0.0)),
    "apparent energy of an oscillation": ("J", lambda m: to_and_fro(m.torque * m.velocity, m.step)),
    "torque of an oscillation": ("N m s", lambda m: to_and_fro(m.torque, m.step)),
    "speed of an oscillation": ("rad", lambda m: to_and_fro(m.velocity, m.step)),
}
"""Bounded numbers: unit of the integral, and what is integrated."""


@dataclass(frozen=True)
class MotionBound:
    """What one bounded number needs and leaves."""

    name: str
    unit: str
    memory: float  # [s]
    needed: float  # largest value of a healthy life
    left: np.ndarray  # energy that each sine gives until the number passes what is needed, shape (k,) [J]
    bar: float  # largest threshold that leaves no more than `BAR_J`; 0 for none
    stopped: float  # share of healthy lives which that threshold would stop [1]


def energy_left(value: np.ndarray, seen: SeenMotion, threshold: float) -> float:
    """Return the energy that a fault gave until a number passed a threshold, or until the watch ended [J]."""
    passed = np.flatnonzero((value > threshold) & seen.fault)
    return float(seen.surplus[passed[0] if passed.size else -1])


def measured_life(law: ExportedLaw, index: int, seed: int) -> list[float]:
    """Return the largest value of each bounded number and memory in one healthy life with mishaps."""
    run = {**with_mishaps(draw_run(law, index, seed), seed, index), "kind": -1.0, "seconds": LIFE_S, "traced": 1.0}
    seen = seen_motion(law, play(law, [run])[0].trace, run["period"])
    return [
        float(forget(number(seen), memory, seen.step).max(initial=0.0))
        for _, number in BOUNDED.values()
        for memory in MEMORIES_S
    ]


def measured_sines(law: ExportedLaw, index: int, seed: int) -> list[tuple[SeenMotion, list[np.ndarray]]]:
    """Return what is seen of every added sine, and the course of each bounded number and memory."""
    runs, _ = fault_runs(law, index, seed, ("drive_sine",))
    made = []
    for played in play(law, [{**run, "traced": 1.0} for run in runs])[1:]:
        seen = seen_motion(law, played.trace, runs[0]["period"])
        if played.result["early"] < 0.0:
            courses = [forget(number(seen), m, seen.step) for _, number in BOUNDED.values() for m in MEMORIES_S]
            made.append((seen, courses))
    return made


def measure_bounds(laws: Sequence[ExportedLaw], seed: int) -> list[MotionBound]:
    """Return what every bounded number needs and leaves, each with the memory that leaves the least."""
    places = [(law, index) for law in laws for index in range(PLANT_COUNT)]
    needs = np.array(list(play_all([partial(measured_life, *place, seed) for place in places])))
    needed = needs.max(axis=0)
    bars = needed[:, None] * np.geomspace(1.0, 0.01, 40)
    left, at_bars = [], []
    for sines in play_all([partial(measured_sines, *place, seed) for place in places]):
        for seen, courses in sines:
            left.append([energy_left(c, seen, limit) for c, limit in zip(courses, needed, strict=True)])
            at_bars.append([[energy_left(c, seen, x) for x in row] for c, row in zip(courses, bars, strict=True)])
    energies, worst = np.array(left), np.array(at_bars).max(axis=0)
    made, size = [], len(MEMORIES_S)
    for number, (name, (unit, _)) in enumerate(BOUNDED.items()):
        own = range(number * size, (number + 1) * size)
        column = min(own, key=lambda i: (energies[:, i].max(), energies[:, i].mean()))
        within = np.flatnonzero(worst[column] <= BAR_J)
        bar = float(bars[column, within[0]]) if within.size else 0.0
        stopped = float((needs[:, column] > bar).mean())
        made.append(MotionBound(name, unit, MEMORIES_S[column % size], float(needed[column]), energies[:, column], bar,
                                stopped))  # fmt: skip
    return made
