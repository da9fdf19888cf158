r"""Choose the model behind the headline: one decision for the friction family and the estimator together.

Every candidate, a family with an estimator, is scored on stretches of the fitted recordings that it was not fitted to.
The score has two parts, whose weights follow from the purpose of the study:

.. math::
   S = (1 - w) \ln E + w \ln P

E is the root mean square error of the effort. P is that of the position in free simulation: the joint starts from the
recorded state, follows the recorded command for at most the horizon, and starts again. The stretches are the blocks of
several cuts of the same data, so that no candidate is chosen because of where one cut happens to lie.

The chosen candidate is the simplest one whose score the best candidate improves on by no more than `min_improvement`, a
share of the error. Simpler is a model with fewer parameters, then the plainer estimator. The standard error of the
difference, from the jackknife over stretches, is reported and decides nothing. Whether a parameter is identifiable
decides what is stated of that parameter, and takes no part either. Held-out recordings reach nothing here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from ... import _core
from ...models.simulate import substeps_for
from ...numerics.block_test import MIN_IMPROVEMENT
from ...numerics.motion import Motion, require_fitted
from ...numerics.regression import Stack, regression_rows
from .estimators import ESTIMATION_METHODS, SolvedMethod
from .friction_solver import residuals_without_blocks
from .replay import DIVERGENCE_THRESHOLD, Machine
from .slip_direction import DirectionChoice


@dataclass(frozen=True)
class ChoiceSettings:
    """Settings of the score by which candidates are compared."""

    # Numbers of blocks into which all data are cut. Each cut is made twice, the second half a block later.
    block_counts: tuple[int, ...] = (5, 10, 20)
    simulation_block_count: int = 10  # Number of blocks of the cuts on which the position is simulated
    horizon_s: float = 2.0  # Longest free simulation [s]
    # Number of stretches of the jackknife. They are as short as the shortest blocks.
    jackknife_stretch_count: int = 20


CHOICE_SETTINGS = ChoiceSettings()

SIMULATION_WEIGHTS: Mapping[str, float] = {"torque": 0.1, "simulation": 1.0}
"""Weight of free simulation in the score, by purpose; the effort has the rest. With 0.1, a simulation that is better by
half outweighs an effort error that is larger by 4 %."""


@dataclass(frozen=True)
class Candidate:
    """A family with an estimator, and how it predicts stretches that it was not fitted to."""

    family: str
    method: str
    parameter_count: int
    effort_error: float  # RMS error of the effort [the effort's unit]
    simulation_error: float | None = None  # RMS error of the simulated position [rad or m]; None if none was simulated
    excess: float = 0.0  # score above that of the best candidate, a logarithm of an error ratio
    standard_error: float = 0.0  # standard error of `excess`

    @property
    def name(self) -> tuple[str, str]:
        """Family and estimator."""
        return self.family, self.method


@dataclass(frozen=True)
class HeadlineChoice:
    """The model behind the headline, with every candidate that it was compared with."""

    family: str
    method: str
    purpose: str = "torque"  # "torque" or "simulation"
    candidates: tuple[Candidate, ...] = ()  # the best first; empty if there was nothing to choose
    horizon: float = field(default=CHOICE_SETTINGS.horizon_s)  # longest free simulation [s]
    min_improvement: float = MIN_IMPROVEMENT  # smallest share of its error by which a candidate is improved on
    direction: DirectionChoice = field(default_factory=DirectionChoice)  # what decides on the sign of friction

    @property
    def best(self) -> Candidate | None:
        """Candidate with the best score; None if there was nothing to choose."""
        return self.candidates[0] if self.candidates else None

    @property
    def chosen(self) -> Candidate | None:
        """The chosen candidate; None if there was nothing to choose."""
        return self.of(self.family, self.method)

    def of(self, family: str, method: str) -> Candidate | None:
        """Return a candidate; None if it was not compared."""
        return next((c for c in self.candidates if c.name == (family, method)), None)

    def best_of(self, family: str) -> Candidate | None:
        """Return the candidate of a family with the best score."""
        return next((c for c in self.candidates if c.family == family), None)

    def methods_of(self, family: str) -> Mapping[str, Candidate]:
        """Return the candidates of a family by their estimator, the plainest first."""
        own = {c.method: c for c in self.candidates if c.family == family}
        return {method: own[method] for method in ESTIMATION_METHODS if method in own}

    @property
    def as_good(self) -> tuple[Candidate, ...]:
        """Candidates whose error the best one improves on by no more than `min_improvement`, the best first."""
        most = -float(np.log1p(-self.min_improvement))
        return tuple(c for c in self.candidates if c.excess <= most)


def choose_headline(
    solved: Mapping[str, Mapping[str, SolvedMethod]],
    data: Stack[Motion],
    machine: Machine,
    purpose: str,
    min_improvement: float = MIN_IMPROVEMENT,
) -> HeadlineChoice:
    """Choose among families and estimators.

    Parameters
    ----------
    solved : mapping of str to mapping of str to SolvedMethod
        Solutions on `data` by family and estimator; each family has "ls".
    data : Stack
        Fitted motions.
    machine : Machine
        Drive, whose recorded commands are simulated.
    purpose : {"torque", "simulation"}
        Purpose, which weighs effort and simulation.
    min_improvement : float
        A candidate counts as good as the best one if the best one saves at most this share of its error.

    Returns
    -------
    HeadlineChoice
    """
    require_fitted(data.motions, "choose_headline")
    every = [(family, method, each) for family, methods in solved.items() for method, each in methods.items()]
    if len(every) == 1:
        return HeadlineChoice(every[0][0], every[0][1], purpose, min_improvement=min_improvement)
    lengths = [len(m.moving) for m in data.motions]
    cuts = [cut for count in CHOICE_SETTINGS.block_counts for cut in make_cuts(lengths, count)]
    simulated_cuts = make_cuts(lengths, CHOICE_SETTINGS.simulation_block_count)
    stretches = make_cuts(lengths, CHOICE_SETTINGS.jackknife_stretch_count)[0]
    weight = SIMULATION_WEIGHTS[purpose] if all(m.command is not None for m in data.motions) else 0.0
    moving, places = np.concatenate([m.moving for m in data.motions]), np.concatenate(stretches)
    blocks = [np.concatenate(cut) for cut in (*cuts, *simulated_cuts)]
    rows, row_blocks = places[moving], [labels[moving] for labels in blocks[: len(cuts)]]
    count = int(places.max()) + 1
    losses = np.zeros((2, len(every), count))
    for i, (_, _, each) in enumerate(every):
        without = each.without_blocks(blocks, moving)
        losses[0, i] = np.bincount(rows, _effort_loss(each, data, row_blocks, without[: len(cuts)]), count)
        if weight > 0.0:
            loss = _position_loss(each, data, simulated_cuts, without[len(cuts) :], machine)
            losses[1, i] = np.bincount(places, loss, count)
    named = [(family, method, len(solved[family]["ls"].model.symbols)) for family, method, _ in every]
    counts = np.array([len(rows), len(places)])
    return decide(named, losses[: 2 if weight > 0.0 else 1], counts, purpose, min_improvement)


def decide(
    named: Sequence[tuple[str, str, int]],
    losses: np.ndarray,
    counts: np.ndarray,
    purpose: str,
    min_improvement: float = MIN_IMPROVEMENT,
) -> HeadlineChoice:
    """Choose the simplest of the candidates that predict as well as the best one.

    Parameters
    ----------
    named : sequence of (str, str, int)
        Family, estimator and number of parameters of each of c candidates.
    losses : ndarray, shape (2, c, b) or (1, c, b)
        Squared errors of the effort, and of the simulated position if there is one, summed over each of b stretches.
    counts : ndarray, shape (2,)
        Number of samples of the effort and of the position.
    purpose : {"torque", "simulation"}
        Purpose, which weighs effort and simulation.
    min_improvement : float
        The best one must save more than this share of an error for the candidate to be worse.

    Returns
    -------
    HeadlineChoice
    """
    is_simulated = len(losses) > 1 and bool(np.all(losses[1].sum(axis=1) > 0.0))
    scores, spread = score_candidates(losses, SIMULATION_WEIGHTS[purpose] if is_simulated else 0.0)
    first = int(np.argmin(scores))
    candidates = [
        Candidate(
            family,
            method,
            count,
            float(np.sqrt(losses[0, i].sum() / counts[0])),
            float(np.sqrt(losses[1, i].sum() / counts[1])) if is_simulated else None,
            float(scores[i] - scores[first]),
            float(spread[i]),
        )
        for i, (family, method, count) in enumerate(named)
    ]
    order = tuple(sorted(candidates, key=lambda c: (c.excess, *_simplicity(c))))
    found = HeadlineChoice(*order[0].name, purpose, order, min_improvement=min_improvement)
    simplest = min(found.as_good, key=_simplicity)
    return replace(found, family=simplest.family, method=simplest.method)


def _simplicity(candidate: Candidate) -> tuple[int, int]:
    return candidate.parameter_count, ESTIMATION_METHODS.index(candidate.method)


def score_candidates(losses: np.ndarray, weight: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the score of each candidate, (c,), and the standard error of its difference from the best one, (c,).

    `losses`, (k, c, b), are the summed squared errors of the effort, and of the simulated position if k is 2, in b
    stretches. `weight` is that of the simulation.
    """

    def score(sums: np.ndarray) -> np.ndarray:
        logs = 0.5 * np.log(np.maximum(sums, np.finfo(float).tiny))
        return (1.0 - weight) * logs[0] + weight * logs[-1]

    sums, b = losses.sum(axis=2), losses.shape[2]
    scores = score(sums)
    without = score(sums[:, :, None] - losses)
    apart = without - without[np.argmin(scores)]
    spread = np.sqrt((b - 1) / b * np.sum((apart - apart.mean(axis=1, keepdims=True)) ** 2, axis=1))
    return scores, spread


def make_cuts(lengths: Sequence[int], count: int) -> list[list[np.ndarray]]:
    """Return two cuts of stretches with `lengths` samples into about `count` blocks, the second half a block later.

    A cut has the block of each sample, (n_i,) per stretch; blocks are numbered over all stretches.
    """
    total = sum(lengths)
    cuts = []
    for shift in (0.0, 0.5):
        first, made = 0, []
        for length in lengths:
            parts = max(1, round(count * length / total))
            labels = np.floor(np.arange(length) * (parts / max(length, 1)) + shift).astype(int)
            labels = np.unique(labels, return_inverse=True)[1]
            made.append(first + labels)
            first += int(labels.max(initial=-1)) + 1
        cuts.append(made)
    return cuts


def _effort_loss(
    solved: SolvedMethod,
    data: Stack[Motion],
    blocks: Sequence[np.ndarray],
    without: Sequence[dict[int, np.ndarray]],
) -> np.ndarray:
    """Return the cross-validated squared error of the effort in each row, (m,), averaged over cuts.

    A cut has the block of each row, (m,), and the values `without` each block.
    """
    values = solved.found.values
    if solved.found.is_exact:
        jacobian, residual = solved.found.jacobian, solved.found.residual
    else:
        jacobian, effort = regression_rows(solved.model, values, data)
        residual = data.target - effort
    loss = np.zeros(len(residual))
    for labels, others in zip(blocks, without, strict=True):
        loss += residuals_without_blocks(residual, jacobian, values, others, labels) ** 2
    return loss / len(blocks)


def _position_loss(
    solved: SolvedMethod,
    data: Stack[Motion],
    cuts: Sequence[Sequence[np.ndarray]],
    without: Sequence[dict[int, np.ndarray]],
    machine: Machine,
) -> np.ndarray:
    """Return the cross-validated squared error of the simulated position, (m,), averaged over cuts.

    A cut has the block of each reduced sample, (n_i,) per stretch, and the values `without` each block. Samples at rest
    count too. Where a simulation leaves the range of motion, its error counts as that range.
    """
    total = np.zeros(sum(len(m.moving) for m in data.motions))
    for labels, others in zip(cuts, without, strict=True):
        losses = [
            np.square(simulated_errors(solved, others, motion, own, machine))
            for motion, own in zip(data.motions, labels, strict=True)
        ]
        total += np.concatenate(losses)
    return total / len(cuts)


def simulated_errors(
    solved: SolvedMethod, without: Mapping[int, np.ndarray], motion: Motion, labels: np.ndarray, machine: Machine
) -> np.ndarray:
    """Return measured minus simulated position at the reduced samples of a motion, (m,) [rad or m].

    The joint starts anew from the recorded state at each block of `labels`, (m,), and after each horizon. A block is
    simulated with the values `without` it, (p,).
    """
    assert motion.command is not None  # motions without one are not simulated
    step = motion.filtering.decimate
    kept = np.arange(len(motion.position))[motion.inner][::step][: len(labels)]
    longest = max(1, round(CHOICE_SETTINGS.horizon_s * motion.fs / step))
    edges = np.concatenate([[0], np.flatnonzero(np.diff(labels)) + 1, [len(labels)]])
    starts = np.concatenate([np.arange(a, b, longest) for a, b in pairwise(edges.tolist())])
    ends = np.append(starts[1:], len(labels))
    span = int((ends - starts).max() * step)
    samples = np.minimum(kept[starts][:, None] + np.arange(span), len(motion.command) - 1)
    vectors = {
        block: solved.model.loaded(solved.model.vector(without.get(block, solved.found.values)), *motion.payload)
        for block in np.unique(labels[starts]).tolist()
    }
    position = _core.simulate_batch(
        np.array([vectors[block] for block in labels[starts].tolist()]),
        reference=np.ascontiguousarray(motion.command[samples], float),
        period=1.0 / motion.fs,
        substeps=substeps_for(1.0 / motion.fs),
        gain=machine.gain,
        back_emf=machine.back_emf,
        position0=motion.position[kept[starts]],
        velocity0=motion.velocity[kept[starts]],
        presliding_travel=motion.filtering.presliding_travel,
        stiction=True,
    )[0]
    owner = np.repeat(np.arange(len(starts)), ends - starts)
    simulated = position[owner, kept - kept[starts][owner]]
    most = max(float(np.ptp(motion.position[motion.inner])), np.finfo(float).tiny)
    error = motion.position[kept] - np.where(np.abs(simulated) < DIVERGENCE_THRESHOLD, simulated, np.inf)
    return np.clip(error, -most, most)
