"""What a person's weight of precision and traits are, found in movements under instructions, and what is predicted.

A weight is set on some of the instructions; between two of them it is their geometric mean. Traits are the same under
every instruction. With few movements a person is taken to be like the others: weights and traits have priors, wide at
first, then as other people's estimates are spread.
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
"""Logarithms are searched of: what arriving is worth [J], k [s], a correction's duration [s], what can be resolved
[rad], what a correction leaves of an error [1]."""

ONE_MOVEMENT_LOG_SD = np.array([0.35, 0.9, 0.35, 0.9, 0.35])
"""Standard deviation of the logarithm of each of `MEASURE_NAMES` that is computed from a single movement.

Computed from n movements, it is divided by the root of n. Chosen by judgement; no measurement is recorded."""

MODEL_LOG_SD = np.array([0.05, 0.10, 0.15, 0.40, 0.15])
"""Standard deviation of the logarithm of each of `MEASURE_NAMES` that is granted to the model's own error.

It is smallest for the duration and the spread, which the model is meant to predict. Chosen by judgement; no measurement
is recorded."""


@dataclass(frozen=True)
class Prior:
    """Normal distributions of logarithms, each shape (k + 5,): weights of the instructions, then traits."""

    mean: np.ndarray
    spread: np.ndarray


WIDE_PRIOR = Prior(
    np.log([1e3, 3e4, 3e5, 1e3, 0.0135, 0.2, 1e-3, 0.1]),
    np.array([2.0, 2.0, 2.0, 1.5, 0.4, 0.35, 0.4, 0.5]),
)
"""Before anybody was seen, of three instructions from quick to precise: dead zones of 6, 1.1 and 0.5 mm that may be
three times as large or small, ends that scatter by 1.4 % of the mean speed times a second, corrections of 0.2 s that
leave a tenth, and 0.4 mm that can be seen."""

SHORTEST, LONGEST = 0.1, 2.0
"""Of primary movements of a hand over a tablet [s]."""


@dataclass(frozen=True)
class Population:
    """What people share: their arm, how they choose, how their aims come out."""

    rig: PointingRig
    person: Person
    outcomes: OutcomeEmulator
    dynamics: tuple[float, float, float]  # Inertia [kg*m^2], viscous [N*m*s/rad], Coulomb friction [N*m]
    choice: Mapping[str, float]
    visual_delay: float  # [s]
    width: float  # [rad/s]

    @classmethod
    def of(cls, rig: PointingRig, *, points: int = 768, count: int = 64, seed: int = 1) -> Self:
        """The mean person of a rig, tried with as many aims and movements as `OutcomeEmulator.simulated` takes."""
        person = draw_people(rig, np.random.default_rng(seed), count=1)[0]
        outcomes = OutcomeEmulator.simulated(rig, person, points=points, count=count, seed=seed)
        choice = {**rig["choice"], "shortest": SHORTEST, "longest": LONGEST}
        dynamics = (person.forearm.inertia, rig["arm"]["viscous"], 0.0)
        seeing, width = rig["vision"]["delay"], rig["planning"]["sign_width"]
        return cls(rig, person, outcomes, dynamics, choice, seeing, width)

    def aim(self, weight: float, traits: np.ndarray) -> tuple[Aim, Accuracy]:
        """Of somebody with the logarithm of a weight, and of traits, shape (5,)."""
        reward, noise, correction, resolution, shortfall = np.exp(traits)
        accuracy = Accuracy(noise, resolution, correction, self.visual_delay, shortfall)
        angle = self.outcomes.tablet.angle
        return choose_aim(angle, self.dynamics, reward, accuracy, np.exp(weight), self.choice, self.width), accuracy

    def expected(self, weight: float, traits: np.ndarray) -> np.ndarray:
        """Logarithms of `MEASURE_NAMES`, shape (5,), as `outcomes` tells them at once."""
        return self.outcomes(*self.aim(weight, traits))

    def simulated(self, weight: float, traits: np.ndarray, *, count: int = 128, seed: int = 1) -> np.ndarray:
        """The same of so many movements that are made."""
        made = point_at_line(self.rig, self.person, *self.aim(weight, traits), count=count, seed=seed)
        return np.log(np.maximum(measure_movements(made), 1e-6))


MeasuredInstructions = Mapping[int, tuple[np.ndarray, int]]
"""By instruction `MEASURE_NAMES`, shape (5,), and of how many movements."""


@dataclass(frozen=True)
class PersonEstimate:
    """A person, as found."""

    instructions: tuple[int, ...]  # Those that the weights are of, ascending
    weights: np.ndarray  # (k,) Logarithms of prices of a squared error [1/rad^2]
    traits: np.ndarray  # (5,) Logarithms, in the order of `TRAIT_NAMES`
    covariance: np.ndarray = field(repr=False)  # (k + 5, k + 5)

    @property
    def numbers(self) -> np.ndarray:
        """Weights and traits, shape (k + 5,)."""
        return np.concatenate([self.weights, self.traits])

    def weight(self, instruction: float) -> float:
        """Logarithm of the weight of an instruction, between those that it was found for by straight lines."""
        return float(np.interp(instruction, self.instructions, self.weights))


def estimate_person(
    population: Population,
    seen: MeasuredInstructions,
    instructions: Sequence[int],
    prior: Prior,
    *,
    off: Mapping[int, np.ndarray] | None = None,
    starts: Sequence[np.ndarray] = (),
) -> PersonEstimate:
    """Weights of `instructions` and traits that are likeliest, given what was `seen` of a person; an instruction that
    was not seen is left to its prior. By instruction, `off` is what `expected` lacks of what is simulated; starts are
    of the search, four of the prior's if there are none."""
    lacks = off or {}
    told = [
        (i, np.log(seen[k][0]) - lacks.get(k, 0.0), _deviation(seen[k][1]))
        for i, k in enumerate(instructions)
        if k in seen
    ]
    n = len(instructions)

    def residuals(numbers: np.ndarray) -> np.ndarray:
        rows = [(numbers - prior.mean) / prior.spread]
        rows += [(population.expected(numbers[i], numbers[n:]) - logs) / sd for i, logs, sd in told]
        return np.concatenate(rows)

    # What is left of an error jumps where corrections set in: several starts, quick to precise.
    shifts = [] if len(starts) else [-1.5, -0.75, 0.0, 0.75]
    starts = [*starts, *(prior.mean + np.r_[prior.spread[:n] * shift, np.zeros(len(TRAIT_NAMES))] for shift in shifts)]
    tries = [least_squares(residuals, each, diff_step=1e-3, x_scale=prior.spread, max_nfev=60) for each in starts]
    best = min(tries, key=lambda each: each.cost)
    covariance = np.linalg.inv(best.jac.T @ best.jac)
    return PersonEstimate(tuple(instructions), best.x[:n], best.x[n:], covariance)


def prior_from_others(others: Sequence[PersonEstimate], wide: Prior) -> Prior:
    """As other people are: medians of their numbers, and their spread with three tenths of the `wide` one's; that one
    itself where there are less than three."""
    if len(others) < 3:
        return wide
    numbers = np.array([one.numbers for one in others])
    spread = np.sqrt(numbers.var(axis=0, ddof=1) + (0.3 * wide.spread) ** 2)
    return Prior(np.median(numbers, axis=0), spread)


def estimate_people(
    population: Population,
    seen: Mapping[str, MeasuredInstructions],
    instructions: Sequence[int],
    wide: Prior,
    *,
    rounds: int = 0,
) -> dict[str, PersonEstimate]:
    """Everybody found twice: from the wide prior, then from that of all others. Then so many `rounds` in which what is
    found is simulated, and found again with what `expected` lacked there; the best of a person's rounds is taken."""
    first = {name: estimate_person(population, told, instructions, wide) for name, told in seen.items()}
    made = {}
    for name, told in seen.items():
        prior = prior_from_others([first[o] for o in first if o != name], wide)
        one = estimate_person(population, told, instructions, prior)
        tried = []
        for _ in range(rounds):
            played = {k: population.simulated(one.weight(k), one.traits) for k in told if k in instructions}
            tried.append((_cost(one, played, told, prior), one))
            off = {k: logs - population.expected(one.weight(k), one.traits) for k, logs in played.items()}
            one = estimate_person(population, told, instructions, prior, off=off, starts=[one.numbers])
        made[name] = min(tried, key=lambda each: each[0])[1] if tried else one
    return made


def _cost(one: PersonEstimate, played: Mapping[int, np.ndarray], told: MeasuredInstructions, prior: Prior) -> float:
    """Sum of squares of somebody as simulated."""
    off = [(logs - np.log(told[k][0])) / _deviation(told[k][1]) for k, logs in played.items()]
    return float(np.sum(((one.numbers - prior.mean) / prior.spread) ** 2) + np.sum(np.square(off)))


def _deviation(count: int) -> np.ndarray:
    """Of `MEASURE_NAMES`'s logarithms from as many movements, with the model's own room, shape (5,)."""
    return np.sqrt(ONE_MOVEMENT_LOG_SD**2 / max(count, 1) * np.array([1.57, 1.0, 1.57, 1.0, 2.0]) + MODEL_LOG_SD**2)
