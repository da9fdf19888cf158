"""Time to calibrate a knee's muscles on five seconds: Pellucid and SciPy with finite differences.

Ten muscles and 55 parameters at 100 Hz, as of walking; true values are sampled about the anatomical model. Both
minimise the same cost from the same start; SciPy uses the core's torque with finite differences. Arrays are
muscle-major. Runs are interleaved; figures are medians.
"""

from __future__ import annotations

import numpy as np
from scipy import optimize

from pellucid.emg.fit.muscle_calibration import MuscleProblem, MuscleSamples, solve_calibration
from pellucid.emg.models.hill import HillData
from pellucid.emg.models.muscle_geometry import muscle_table

from ._size import sized
from .identification import _row, interleaved

MUSCLES = (
    "rectus_femoris", "vastus_medialis", "vastus_intermedius", "vastus_lateralis", "biceps_femoris_long",
    "biceps_femoris_short", "semimembranosus", "semitendinosus", "gastrocnemius_medialis", "gastrocnemius_lateralis",
)  # fmt: skip
"""Muscles of the simulated recording."""

SAMPLE_COUNT = sized(500, smallest=100)
"""Number of samples of the simulated recording."""

PERIOD_S = 0.01
"""Sampling period [s]."""


def problem() -> MuscleProblem:
    """Five seconds of a leg that swings, with noise of 1 N m."""
    table, rng = muscle_table(), np.random.default_rng(2)
    t = PERIOD_S * np.arange(SAMPLE_COUNT)
    phase = {"hip": 0.0, "knee": 1.0, "ankle": 2.0}
    middle = {"hip": 0.3, "knee": -0.6, "ankle": 0.0}
    angles = {j: middle[j] + 0.4 * np.sin(5.5 * t + p) for j, p in phase.items()}
    rates = {j: 0.4 * 5.5 * np.cos(5.5 * t + p) for j, p in phase.items()}
    paths = [table.geometry[m] for m in MUSCLES]
    bursts = np.abs(np.sin(2.75 * t + np.linspace(0.0, 3.0, len(MUSCLES))[:, None])) ** 5
    data = HillData(
        0.5 * bursts,
        [p.length(angles) for p in paths],
        [p.rate(angles, rates) for p in paths],
        [p.moment_arm("knee", angles) for p in paths],
        PERIOD_S,
    )
    samples = MuscleSamples(data, t.copy(), angles["knee"], rates["knee"], np.ones(SAMPLE_COUNT))
    muscles = [table.constants[m] for m in MUSCLES]
    asked = MuscleProblem(muscles, samples)
    z = np.clip(rng.normal(0.0, 1.0, len(asked.lower)), asked.lower, asked.upper)
    torque = asked.torque(z) + rng.normal(0.0, 1.0, SAMPLE_COUNT)
    return MuscleProblem(muscles, MuscleSamples(data, torque, samples.angle, samples.speed, samples.weight))


def plain(asked: MuscleProblem) -> optimize.OptimizeResult:
    """The same cost by SciPy, differentiated by differences."""
    spread = asked.scale * np.sqrt(asked.count)

    def residual(z: np.ndarray) -> np.ndarray:
        return np.concatenate(((asked.torque(z) - asked.samples.torque) / spread, asked.weight * z))

    start = np.clip(np.zeros(len(asked.lower)), asked.lower + 1e-9, asked.upper - 1e-9)
    return optimize.least_squares(residual, start, bounds=(asked.lower, asked.upper), max_nfev=200)


def run() -> list[dict]:
    """Rows of name, value, unit, note."""
    asked = problem()
    one, three, theirs = interleaved(
        lambda: solve_calibration(asked, starts=1), lambda: solve_calibration(asked), lambda: plain(asked)
    )
    ratio = [b / a for a, b in zip(one, theirs, strict=True)]
    ours, other = solve_calibration(asked, starts=1).cost, float(plain(asked).cost)
    name = "calibrating ten muscles, 55 parameters"
    return [
        _row(name, one, "s", "Pellucid, from anatomy"),
        _row(f"{name}, three starts", three, "s", "Pellucid"),
        _row(f"{name}, differences", theirs, "s", "SciPy least_squares on the core's torque, from anatomy"),
        _row(f"{name}, differences over Pellucid", ratio, "1", "pair by pair"),
        {"name": f"{name}, cost over SciPy's", "value": ours / other, "unit": "1", "note": "1 is as low"},
    ]
