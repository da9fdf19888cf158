"""Train a subject's muscles: Adam with a fixed and with a falling rate on parts of the data, and a particle swarm."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import cycle

import numpy as np

from pellucid.emg.estimators.muscle_trials import find_driven_muscles, make_muscle_samples
from pellucid.emg.estimators.torque_trial import TorqueTrial
from pellucid.emg.fit.muscle_calibration import MuscleProblem, solve_calibration
from pellucid.numerics.searches.adam import AdamPath, adam
from pellucid.numerics.searches.swarm import Search, swarm_with_gradients

TRAINED_QUANTITIES: dict[str, str] = {
    "strength": "k_r",
    "shape": "A",
    "optimal_length_shift": "λ",
    "tendon_slack_length": "k_s",
    "max_velocity": "k_v",
}
"""Trained quantities, each with the paper's parameter of the same effect, in the paper's order of convergence."""

ADAM_ITERATIONS = 1500
"""Iterations of Adam. The paper prints no number; chosen by judgement."""

ADAM_RATE = 0.02
"""Learning rate of Adam, at first where it falls, in standard deviations of a parameter among people."""

ADAM_FINAL_RATE = 2e-5
"""Learning rate at the last iteration where it falls, in the same unit."""

GRADIENT_SPAN_S = 2.0
"""A gradient on a part of the data uses this long a stretch, which is about one swing."""

ARRIVAL_COST_FACTOR = 1.05
"""An optimiser has arrived when its cost is below the lowest known cost times this factor."""


@dataclass(frozen=True, eq=False)
class Training:
    """One subject's muscles, trained in three ways on one cost."""

    names: tuple[str, ...]  # Names of the parameters
    # Parameters of all three are in standard deviations from anatomy.
    falling: AdamPath = field(repr=False)  # Adam with a falling rate on parts of the data
    fixed: AdamPath = field(repr=False)  # Adam with a fixed rate on parts of the data
    whole: AdamPath = field(repr=False)  # Adam with a falling rate on all data at once
    swarm: Search = field(repr=False)
    lowest: float  # Cost that bounded least squares reaches
    least_squares: int  # Evaluations of the cost that least squares needed
    values: dict[str, float]  # Result of Adam on all data, by quantity of `TRAINED_QUANTITIES`, mean over muscles

    @property
    def spread_ratio(self) -> float:
        """Spread of a parameter over the last hundred iterations, with the fixed rate over that with the falling one.

        It is the median over the parameters that still move [1].
        """
        fixed, falling = self.fixed.spread(), self.falling.spread()
        moves = fixed > 1e-9
        return float(np.median(fixed[moves] / np.maximum(falling[moves], 1e-12)))

    @property
    def converged(self) -> dict[str, float]:
        """Iteration from which on each quantity stays near its last value, mean over muscles."""
        at = dict(zip(self.names, self.whole.converged_at(), strict=True))
        return {q: float(np.mean([v for n, v in at.items() if n.split(".")[0] == q])) for q in TRAINED_QUANTITIES}

    def evaluations(self, way: str) -> float:
        """Return the evaluations of the cost until it is below `ARRIVAL_COST_FACTOR` times the lowest; NaN if never.

        `way` is "swarm" or, for Adam on all data, any other name.
        """
        goal = ARRIVAL_COST_FACTOR * self.lowest
        if way == "swarm":
            return float(self.swarm.evaluations_until(goal) or np.nan)
        arrived = np.flatnonzero(self.whole.costs <= goal)
        return float(arrived[0] + 1) if arrived.size else float("nan")


def train(trial: TorqueTrial, weight: float) -> Training:
    """Train a subject's muscles on the recording to be fitted."""
    muscles = find_driven_muscles([trial])
    samples, _ = make_muscle_samples([trial], muscles=[m.name for m in muscles])
    problem = MuscleProblem(muscles, samples, quantities=tuple(TRAINED_QUANTITIES), weight=weight)
    size = round(GRADIENT_SPAN_S * trial.fs)
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
    options = {"rate": ADAM_RATE, "iterations": ADAM_ITERATIONS, "lower": problem.lower, "upper": problem.upper}
    found = solve_calibration(problem)
    whole = adam(problem.cost_and_gradient, start, final_rate=ADAM_FINAL_RATE, **options)
    ended = dict(zip(problem.names, problem.values(whole.last), strict=True))
    return Training(
        problem.names,
        adam(on_parts(), start, final_rate=ADAM_FINAL_RATE, **options),
        adam(on_parts(), start, **options),
        whole,
        swarm_with_gradients(
            problem.cost, problem.cost_and_gradient, problem.lower, problem.upper, rng=np.random.default_rng(5)
        ),
        found.cost,
        found.evaluations,
        {q: float(np.mean([v for n, v in ended.items() if n.split(".")[0] == q])) for q in TRAINED_QUANTITIES},
    )
