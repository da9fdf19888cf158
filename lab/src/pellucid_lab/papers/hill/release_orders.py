"""Section 3.3's outlook: some of the muscles' parameters are fixed first and released later, in stated orders.

Every order ends with all parameters free, except `HELD_AFTER_RELEASE`, in which a parameter moves in its own stage
alone. Adam divides the same number of iterations among the stages of an order, each with a falling rate; bounded least
squares ends each stage by its own tolerance. Both begin at anatomy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pellucid.emg.estimators.muscle_trials import find_driven_muscles, make_muscle_samples
from pellucid.emg.fit.muscle_calibration import FIT_SEARCH, MuscleProblem, MuscleSamples
from pellucid.emg.models.hill import HillMuscle
from pellucid.numerics.searches.adam import adam
from pellucid.numerics.searches.bounded_least_squares import bounded_least_squares

from .training import ADAM_FINAL_RATE, ADAM_ITERATIONS, ADAM_RATE, TRAINED_QUANTITIES
from .trials import ActiveSwing

Stages = tuple[tuple[str, ...], ...]
"""Quantities that are free in each stage of an order."""


def released_in_turn(*groups: tuple[str, ...]) -> Stages:
    """Return the stages in which one group after another is released, and what is released stays free."""
    return tuple(sum(groups[: i + 1], ()) for i in range(len(groups)))


ALL_AT_ONCE = "all_at_once"
"""Name of the reference method: every step fits every parameter, as in the paper."""

STRENGTH_ALONE = "strength_alone"
"""Name of the simplest reference method: only the muscles' strengths are fitted."""

HELD_AFTER_RELEASE = "quick_first_then_held"
"""Name of the order in which a parameter is held again after its stage."""

_QUICK_FIRST = tuple((quantity,) for quantity in TRAINED_QUANTITIES)

RELEASE_ORDERS: Mapping[str, Stages] = {
    ALL_AT_ONCE: (tuple(TRAINED_QUANTITIES),),
    "quick_first": released_in_turn(*_QUICK_FIRST),
    "slow_first": released_in_turn(*_QUICK_FIRST[::-1]),
    "activation_first": released_in_turn(
        ("shape",), ("strength",), ("tendon_slack_length", "optimal_length_shift"), ("max_velocity",)
    ),
    "geometry_first": released_in_turn(
        ("tendon_slack_length", "optimal_length_shift"), ("strength",), ("shape",), ("max_velocity",)
    ),
    HELD_AFTER_RELEASE: _QUICK_FIRST,
    STRENGTH_ALONE: (("strength",),),
}
"""Orders of release by name; "quick" and "slow" are by the paper's order of convergence, Fig. 7."""

RELEASE_METHODS = ("adam", "least_squares")
"""The paper's optimiser, and the toolkit's."""

LEAST_SQUARES_ITERATIONS = 60
"""Largest number of iterations of bounded least squares in one stage."""

DELAY_QUANTITY = "delay"
"""The quantity that the paper fixes at 20 ms, and its section 5 wants to be searched."""


@dataclass(frozen=True, eq=False)
class ReleasedMuscles:
    """Muscles that were calibrated in one order of release."""

    z: np.ndarray = field(repr=False)  # (p,) parameters in standard deviations among people
    cost: float  # cost at the end, of the samples that were fitted
    evaluations: int  # evaluations of the cost


def calibrate_in_order(
    problem: MuscleProblem, stages: Sequence[Sequence[str]], method: str, iterations: int = ADAM_ITERATIONS
) -> ReleasedMuscles:
    """Calibrate muscles from anatomy with `stages`, by one of `RELEASE_METHODS`.

    `iterations` is the number of Adam's iterations over all stages together.
    """
    z, spent = np.clip(np.zeros(len(problem.names)), problem.lower, problem.upper), 0
    cost = problem.cost(z)
    tissue = np.ones(len(problem.names) - len(problem.priors), bool)
    for stage in stages:
        free = np.concatenate(([p.free.quantity in stage for p in problem.priors], tissue)).astype(bool)
        low, high = np.where(free, problem.lower, z), np.where(free, problem.upper, z)
        if method == "least_squares":
            end = bounded_least_squares(
                problem.equations, z, low, high, iterations=LEAST_SQUARES_ITERATIONS,
                tolerance=FIT_SEARCH.cost_tolerance,
            )  # fmt: skip
            z, cost, spent = end.x, end.cost, spent + end.evaluations
        else:
            path = adam(
                problem.cost_and_gradient, z, rate=ADAM_RATE, final_rate=ADAM_FINAL_RATE,
                iterations=iterations // len(stages), lower=low, upper=high,
            )  # fmt: skip
            z, spent = path.last, spent + path.evaluations
            cost = problem.cost(z)
    return ReleasedMuscles(z, cost, spent)


@dataclass(frozen=True, eq=False)
class PersonalMuscles:
    """What is needed to calibrate one person's muscles to a swing, and to score them on others."""

    muscles: tuple[HillMuscle, ...]
    samples: MuscleSamples = field(repr=False)

    @staticmethod
    def from_swing(swing: ActiveSwing) -> PersonalMuscles:
        """Return the muscles that the swing's EMG drives, with the swing's samples."""
        muscles = find_driven_muscles([swing.trial])
        samples, _ = make_muscle_samples([swing.trial], muscles=[m.name for m in muscles])
        return PersonalMuscles(muscles, samples)

    def problem(self, quantities: Sequence[str] = tuple(TRAINED_QUANTITIES)) -> MuscleProblem:
        """Return the calibration to the whole swing."""
        return MuscleProblem(self.muscles, self.samples, quantities=quantities, weight=FIT_SEARCH.anatomy_weight)

    def half(self, which: int) -> MuscleProblem:
        """Return the calibration to the first (0) or second (1) half of the swing alone."""
        n = len(self.samples.torque)
        counted = np.arange(n // 2) if which == 0 else np.arange(n // 2, n)
        samples = self.samples.only(counted)
        return MuscleProblem(
            self.muscles, samples, quantities=tuple(TRAINED_QUANTITIES), weight=FIT_SEARCH.anatomy_weight
        )


def torque_error(problem: MuscleProblem, z: np.ndarray, swing: ActiveSwing) -> float:
    """Return the RMS error of the torque against the muscles' true active torque in a `swing` [N m]."""
    samples, (counted,) = make_muscle_samples([swing.trial], muscles=[m.name for m in problem.model.muscles])
    return float(np.sqrt(np.mean((problem.torque(z, samples)[counted] - swing.active) ** 2)))


def errors_over_all_at_once(
    fitted: ActiveSwing, heldout: ActiveSwing, method: str = "least_squares"
) -> dict[str, float]:
    """Return the error on a held-out swing of each order over that of all parameters at once [1]."""
    problem = PersonalMuscles.from_swing(fitted).problem()
    errors = {
        name: torque_error(problem, calibrate_in_order(problem, stages, method).z, heldout)
        for name, stages in RELEASE_ORDERS.items()
    }
    return {name: error / errors[ALL_AT_ONCE] for name, error in errors.items() if name != ALL_AT_ONCE}
