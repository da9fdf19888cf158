"""Estimation of a person's weights of precision and traits from movements under instructions, and prediction from them.

Each instruction, from "as quickly as possible" to "as precisely as possible", has a weight: the price of a squared
error (`speed_accuracy`). Weights are estimated for some of the instructions; between two of them the weight is
interpolated geometrically. Traits are the same under every instruction. Both have a prior, so that a person with few
movements is estimated to be like the others: first a wide prior, then the distribution of the other people's estimates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

import numpy as np
from scipy.optimize import least_squares

from .line_pointing import OutcomeEmulator, measure_movements, point_at_line
from .people import Person, draw_people
from .speed_accuracy import Accuracy, Aim, choose_aim

if TYPE_CHECKING:
    from .rig import PointingRig

TRAIT_NAMES = ("reward", "noise", "correction", "resolution", "shortfall")
"""Traits of a person, in the order of every array; their logarithms are estimated.

Reward of arriving [J], k: noise of a movement [s], duration of a correction [s], resolution of the eye [rad], and share
of an error that a correction leaves [1]; see `speed_accuracy.Accuracy`."""

ONE_MOVEMENT_LOG_SD = np.array([0.35, 0.9, 0.35, 0.9, 0.35])
"""Standard deviation of the logarithm of a single movement's measures, in the order of `MEASURE_NAMES`.

Chosen by judgement; no measurement is recorded."""

ESTIMATE_VARIANCE_FACTORS = np.array([1.57, 1.0, 1.57, 1.0, 2.0])
"""Variance of each of `MEASURE_NAMES` over that of a mean of as many movements.

A median of n normal values has pi/2 = 1.57 times the variance of their mean, a quantile of 80 % about 2 times."""

MODEL_LOG_SD = np.array([0.05, 0.10, 0.15, 0.40, 0.15])
"""Standard deviation of the logarithm of each of `MEASURE_NAMES` that is allowed for errors of the model.

It is smallest for the duration and the spread of the end, which the model is meant to predict. Chosen by judgement; no
measurement is recorded."""

MIN_PRIOR_SPREAD_SHARE = 0.3
"""Share of the wide prior's standard deviation that is added, as root of squares, to the spread between other people.

Chosen by judgement; no measurement is recorded."""


@dataclass(frozen=True)
class Prior:
    """Normal distributions of the logarithms of weights and traits.

    Both arrays have shape (k + 5,): the weights of k instructions, then the traits.
    """

    mean: np.ndarray
    spread: np.ndarray  # standard deviations


WIDE_PRIOR = Prior(
    np.log([1e3, 3e4, 3e5, 1e3, 0.0135, 0.2, 1e-3, 0.1]),
    np.array([2.0, 2.0, 2.0, 1.5, 0.4, 0.35, 0.4, 0.5]),
)
"""Prior before anybody's movements are known, for three instructions from quick to precise.

The weights correspond to dead zones of 6, 1.1 and 0.5 mm, each uncertain by a factor of three. A movement ends with a
standard deviation of 1.4 % of its mean speed times a second. Corrections take 0.2 s and leave a tenth of the error; the
eye resolves 0.4 mm. Chosen by judgement; no measurement is recorded."""

PRIMARY_MOVEMENT_BOUNDS_S = (0.1, 2.0)
"""Shortest and longest primary movement of a hand over a tablet [s]."""


@dataclass(frozen=True)
class Population:
    """Everything that people share: their arm, how they choose an aim, and what follows from an aim."""

    rig: PointingRig
    person: Person
    outcomes: OutcomeEmulator
    dynamics: tuple[float, float, float]  # inertia [kg*m^2], viscous [N*m*s/rad] and Coulomb friction [N*m]
    choice: Mapping[str, float]  # table ``[choice]`` of the rig's file, with `PRIMARY_MOVEMENT_BOUNDS_S`
    visual_delay: float  # [s]
    width: float  # velocity over which the sign of friction changes [rad/s]

    @classmethod
    def from_rig(cls, rig: PointingRig, *, points: int = 768, count: int = 64, seed: int = 1) -> Self:
        """Make a population of a rig's mean person, with an emulator from `OutcomeEmulator.fit_to_simulation`."""
        person = draw_people(rig, np.random.default_rng(seed), count=1)[0]
        outcomes = OutcomeEmulator.fit_to_simulation(rig, person, points=points, count=count, seed=seed)
        shortest, longest = PRIMARY_MOVEMENT_BOUNDS_S
        choice = {**rig["choice"], "shortest": shortest, "longest": longest}
        dynamics = (person.forearm.inertia, rig.constants.arm.viscous, 0.0)
        visual_delay, width = rig["vision"]["delay"], rig["planning"]["sign_width"]
        return cls(rig, person, outcomes, dynamics, choice, visual_delay, width)

    def choose_aim(self, weight: float, traits: np.ndarray) -> tuple[Aim, Accuracy]:
        """Return the aim and the accuracy of a person with the logarithms of a weight and of traits, shape (5,)."""
        reward, noise, correction, resolution, shortfall = np.exp(traits)
        accuracy = Accuracy(noise, resolution, correction, self.visual_delay, shortfall)
        angle = self.outcomes.tablet.angle
        return choose_aim(angle, self.dynamics, reward, accuracy, np.exp(weight), self.choice, self.width), accuracy

    def emulate_measures(self, weight: float, traits: np.ndarray) -> np.ndarray:
        """Return the logarithms of `MEASURE_NAMES` as the emulator predicts them, shape (5,)."""
        return self.outcomes(*self.choose_aim(weight, traits))

    def simulate_measures(self, weight: float, traits: np.ndarray, *, count: int = 128, seed: int = 1) -> np.ndarray:
        """Return the logarithms of `MEASURE_NAMES` of `count` simulated movements, shape (5,)."""
        movements = point_at_line(self.rig, self.person, *self.choose_aim(weight, traits), count=count, seed=seed)
        return np.log(np.maximum(measure_movements(movements), 1e-6))


MeasuredInstructions = Mapping[int, tuple[np.ndarray, int]]
"""Measures of one person's movements under each instruction, shape (5,), and the number of these movements."""


@dataclass(frozen=True)
class PersonEstimate:
    """The estimated weights and traits of a person."""

    instructions: tuple[int, ...]  # instructions whose weights were estimated, ascending
    weights: np.ndarray  # (k,) logarithms of the price of a squared error [1/rad^2]
    traits: np.ndarray  # (5,) logarithms, in the order of `TRAIT_NAMES`
    covariance: np.ndarray = field(repr=False)  # (k + 5, k + 5)

    @property
    def numbers(self) -> np.ndarray:
        """Return weights and traits together, shape (k + 5,)."""
        return np.concatenate([self.weights, self.traits])

    def weight(self, instruction: float) -> float:
        """Return the logarithm of the weight of an instruction, linearly interpolated between the estimated ones."""
        return float(np.interp(instruction, self.instructions, self.weights))


def estimate_person(
    population: Population,
    measured: MeasuredInstructions,
    instructions: Sequence[int],
    prior: Prior,
    *,
    corrections: Mapping[int, np.ndarray] | None = None,
    starts: Sequence[np.ndarray] = (),
) -> PersonEstimate:
    """Return the most probable weights and traits of a person.

    Parameters
    ----------
    population : Population
    measured : mapping
        The person's measures by instruction. The prior determines the weight of an instruction without measures.
    instructions : sequence of int
        Instructions whose weights are estimated, ascending.
    prior : Prior
    corrections : mapping, optional
        Simulated minus emulated logarithms of the measures by instruction, shape (5,); by default zero.
    starts : sequence of ndarray, optional
        Starting points of the search, shape (k + 5,) each; by default four points about the prior's mean.
    """
    corrections = corrections or {}
    rows = [
        (i, np.log(measured[k][0]) - corrections.get(k, 0.0), _log_standard_deviation(measured[k][1]))
        for i, k in enumerate(instructions)
        if k in measured
    ]
    n = len(instructions)

    def residuals(numbers: np.ndarray) -> np.ndarray:
        parts = [(numbers - prior.mean) / prior.spread]
        parts += [(population.emulate_measures(numbers[i], numbers[n:]) - logs) / sd for i, logs, sd in rows]
        return np.concatenate(parts)

    # The remaining error jumps where corrections set in. Several starts, from quick to precise, avoid a local minimum.
    shifts = [] if len(starts) else [-1.5, -0.75, 0.0, 0.75]
    starts = [
        *starts,
        *(prior.mean + np.r_[prior.spread[:n] * shift, np.zeros(len(TRAIT_NAMES))] for shift in shifts),
    ]
    tries = [least_squares(residuals, start, diff_step=1e-3, x_scale=prior.spread, max_nfev=60) for start in starts]
    best = min(tries, key=lambda each: each.cost)
    covariance = np.linalg.inv(best.jac.T @ best.jac)
    return PersonEstimate(tuple(instructions), best.x[:n], best.x[n:], covariance)


def prior_from_others(others: Sequence[PersonEstimate], wide: Prior) -> Prior:
    """Return a prior from other people's estimates: their median, and their spread with a share of the `wide` prior's.

    With fewer than three people the `wide` prior itself is returned.
    """
    if len(others) < 3:
        return wide
    numbers = np.array([one.numbers for one in others])
    spread = np.sqrt(numbers.var(axis=0, ddof=1) + (MIN_PRIOR_SPREAD_SHARE * wide.spread) ** 2)
    return Prior(np.median(numbers, axis=0), spread)


def estimate_people(
    population: Population,
    measured: Mapping[str, MeasuredInstructions],
    instructions: Sequence[int],
    wide: Prior,
    *,
    rounds: int = 0,
) -> dict[str, PersonEstimate]:
    """Estimate every person twice: with the `wide` prior, then with a prior from all others.

    In each of so many further `rounds` the estimate is simulated, and estimated again with the emulator corrected by
    what the simulation showed. The round with the smallest cost is kept.
    """
    first = {name: estimate_person(population, own, instructions, wide) for name, own in measured.items()}
    estimates = {}
    for name, own in measured.items():
        prior = prior_from_others([first[other] for other in first if other != name], wide)
        one = estimate_person(population, own, instructions, prior)
        candidates = []
        for _ in range(rounds):
            simulated = {k: population.simulate_measures(one.weight(k), one.traits) for k in own if k in instructions}
            candidates.append((_cost(one, simulated, own, prior), one))
            corrections = {
                k: logs - population.emulate_measures(one.weight(k), one.traits) for k, logs in simulated.items()
            }
            one = estimate_person(population, own, instructions, prior, corrections=corrections, starts=[one.numbers])
        estimates[name] = min(candidates, key=lambda candidate: candidate[0])[1] if candidates else one
    return estimates


def _cost(
    one: PersonEstimate, simulated: Mapping[int, np.ndarray], measured: MeasuredInstructions, prior: Prior
) -> float:
    """Return the sum of squared residuals of an estimate, of its simulated movements and of its prior."""
    residuals = [
        (logs - np.log(measured[k][0])) / _log_standard_deviation(measured[k][1]) for k, logs in simulated.items()
    ]
    return float(np.sum(((one.numbers - prior.mean) / prior.spread) ** 2) + np.sum(np.square(residuals)))


def _log_standard_deviation(count: int) -> np.ndarray:
    """Return the standard deviation of the logarithms of `MEASURE_NAMES` over `count` movements, shape (5,).

    It includes the error that is allowed for the model.
    """
    return np.sqrt(ONE_MOVEMENT_LOG_SD**2 / max(count, 1) * ESTIMATE_VARIANCE_FACTORS + MODEL_LOG_SD**2)
