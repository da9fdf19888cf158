"""Ways down to a subject's muscles: Adam with a fixed rate and a falling one on parts of the data, and a swarm."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import cycle

import numpy as np

from ...estimators.muscle_trials import find_driven_muscles, make_muscle_samples
from ...estimators.torque_trial import TorqueTrial
from ...fit.muscles.muscle_calibration import MuscleProblem, solve_calibration
from ...fit.searches.adam import AdamPath, adam
from ...fit.searches.swarm import Search, swarm_with_gradients

TRAINED: dict[str, str] = {
    "strength": "k_r",
    "shape": "A",
    "optimal_length_shift": "λ",
    "tendon_slack_length": "k_s",
    "max_velocity": "k_v",
}
"""What is trained, and the parameter of the paper that does the same, in the paper's order of convergence."""

ITERATIONS, RATE, FINAL_RATE = 1500, 0.02, 2e-5
"""Of Adam, in standard deviations among people."""

PART = 2.0
"""Data of each gradient [s]: about a swing."""

NEAR = 1.05
"""Times the lowest cost, below which a way down has arrived."""


@dataclass(frozen=True, eq=False)
class Training:
    """One subject's muscles, trained in three ways on one cost."""

    names: tuple[str, ...]  # Of the parameters
    falling: AdamPath = field(repr=False)  # falling, fixed: On parts of the data, in standard deviations from anatomy.
    fixed: AdamPath = field(repr=False)
    whole: AdamPath = field(repr=False)  # A falling rate on all data at once
    swarm: Search = field(repr=False)
    lowest: float  # Cost that bounded least squares reaches
    least_squares: int  # Evaluations it took
    values: dict[str, float]  # Where Adam on all data ended, by quantity of `TRAINED`, mean over muscles

    @property
    def spread_ratio(self) -> float:
        """Of the parameters over the last hundred iterations, fixed rate over falling, median of what moves."""
        fixed, falling = self.fixed.spread(), self.falling.spread()
        moves = fixed > 1e-9
        return float(np.median(fixed[moves] / np.maximum(falling[moves], 1e-12)))

    @property
    def converged(self) -> dict[str, float]:
        """Iteration from which on each quantity stays near where it ends, mean over muscles."""
        at = dict(zip(self.names, self.whole.converged_at(), strict=True))
        return {q: float(np.mean([v for n, v in at.items() if n.split(".")[0] == q])) for q in TRAINED}

    def evaluations(self, way: str) -> float:
        """Evaluations of the cost until it is within `NEAR` of the lowest; NaN if it never is."""
        goal = NEAR * self.lowest
        if way == "swarm":
            return float(self.swarm.evaluations_until(goal) or np.nan)
        arrived = np.flatnonzero(self.whole.costs <= goal)
        return float(arrived[0] + 1) if arrived.size else float("nan")


def train(trial: TorqueTrial, weight: float) -> Training:
    """Train a subject's muscles on the recording to be fitted."""
    muscles = find_driven_muscles([trial])
    samples, _ = make_muscle_samples([trial], muscles=[m.name for m in muscles])
    problem = MuscleProblem(muscles, samples, quantities=tuple(TRAINED), weight=weight)
    size = round(PART * trial.fs)
    parts = [np.arange(i, min(i + size, len(samples.torque))) for i in range(0, len(samples.torque) - size // 2, size)]
    counted = [p[samples.weight[p] > 0.0] for p in parts]
    pieces = [p for p in counted if p.size > size // 2]

    def on_parts():
        following = cycle(pieces)

        def cost(z: np.ndarray) -> tuple[float, np.ndarray]:
            here = next(following)
            torque, slopes = problem.jacobian(z)
            error = (torque[here] - samples.torque[here]) / problem.scale
            pull = weight**2
            value = 0.5 * float(np.mean(error**2)) + 0.5 * pull * float(z @ z)
            return value, slopes[:, here] @ error / (here.size * problem.scale) + pull * z

        return cost

    start = np.clip(np.zeros(len(problem.lower)), problem.lower, problem.upper)
    options = {"rate": RATE, "iterations": ITERATIONS, "lower": problem.lower, "upper": problem.upper}
    found = solve_calibration(problem)
    whole = adam(problem.cost_and_gradient, start, final_rate=FINAL_RATE, **options)
    ended = dict(zip(problem.names, problem.values(whole.last), strict=True))
    return Training(
        problem.names,
        adam(on_parts(), start, final_rate=FINAL_RATE, **options),
        adam(on_parts(), start, **options),
        whole,
        swarm_with_gradients(
            problem.cost, problem.cost_and_gradient, problem.lower, problem.upper, rng=np.random.default_rng(5)
        ),
        found.cost,
        found.evaluations,
        {q: float(np.mean([v for n, v in ended.items() if n.split(".")[0] == q])) for q in TRAINED},
    )
