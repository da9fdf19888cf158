r"""Muscle synergies: a few groups of muscles, each with one activation over time, that reconstruct all envelopes.

Envelopes E (n samples, m muscles), each relative to its own maximum, are factored by scikit-learn into non-negative
activations H and weights W of k synergies [1]_ [2]_,

.. math::
   E \approx H W, \qquad \mathrm{VAF} = 1 - \frac{\sum (E - H W)^2}{\sum E^2}.

With fixed weights, more synergies always reconstruct more of held-out samples, so that their variance accounted for
chooses no number without a threshold [3]_. The number is therefore chosen by bi-cross-validation [4]_: one muscle
of held-out samples is predicted from the activations that the other muscles show, and each muscle
takes its turn. The error has a minimum. The number is the smallest whose error lies within one standard error of it,
over the blocks of time; its interval is that of the same choice on blocks drawn with replacement. The prediction is
also how a muscle without an electrode is filled in. If the recorded muscles hardly determine the activation of a
synergy, a ridge limits it: the variance of the error over that of H.

.. [1] D. D. Lee, H. S. Seung, "Learning the parts of objects by non-negative matrix factorization", Nature 401, 1999.
.. [2] A. d'Avella, P. Saltiel, E. Bizzi, "Combinations of muscle synergies in the construction of a natural motor
   behavior", Nature Neuroscience 6, 2003.
.. [3] G. Torres-Oviedo, L. H. Ting, "Muscle synergies characterizing human postural responses", J. Neurophysiology 98,
   2007.
.. [4] A. B. Owen, P. O. Perry, "Bi-cross-validation of the SVD and the nonnegative matrix factorization", Annals of
   Applied Statistics 3, 2009.

Muscle synergies from arrays of envelopes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import IdentificationError
from ..._tabular import data_frame, html_table, text_table
from ...numerics.nonnegative_factors import nonnegative_factors
from .cross_validation import block_folds


@dataclass(frozen=True)
class SynergySettings:
    """How envelopes are factored, and which number of synergies suffices.

    No measurement is recorded for what is chosen by judgement.
    """

    seed: int = 19990  # Seed of random draws of weights
    max_iterations: int = 500  # Largest number of iterations of the factorisation
    # Smallest number of muscles by default. Two muscles have a single synergy, their common activation.
    min_muscles: int = 3
    min_vaf: float = 0.9  # Held-out variance accounted for that synergies have by convention [3]_
    interval: float = 0.9  # Probability of the interval of the number
    draw_count: int = 500  # Draws of blocks with replacement, for that interval
    # Number of blocks of time that are left out in turn if there is no held-out recording. Chosen by judgement.
    block_count: int = 5
    fold_gap_s: float = 0.2  # Gap between fitted and test samples [s]. Chosen by judgement.


SYNERGY_FIT = SynergySettings()


@dataclass(frozen=True, eq=False)
class Synergies:
    """Muscle synergies: groups of muscles with fixed weights."""

    muscles: tuple[str, ...]
    weights: np.ndarray  # Weight of each muscle in each synergy, shape (k, m); the largest of a synergy is 1
    ridge: float = 0.0  # Variance of the reconstruction error over the variance of the activations

    def __len__(self) -> int:
        return len(self.weights)

    def activations(self, envelopes: np.ndarray, seen: Sequence[int] | None = None) -> np.ndarray:
        """Return the activation of each synergy, shape (n, k), from envelopes of shape (n, m).

        If `seen` is given, only the envelopes of these muscles are used.
        """
        columns = list(range(len(self.muscles)) if seen is None else seen)
        return solve_non_negative(self.weights[:, columns].T, np.asarray(envelopes, float)[:, columns].T, self.ridge).T

    def reconstruct(self, envelopes: np.ndarray, seen: Sequence[int] | None = None) -> np.ndarray:
        """Reconstruct all envelopes, shape (n, m), from those of the muscles `seen`."""
        return self.activations(envelopes, seen) @ self.weights

    def predict_muscle(self, envelopes: np.ndarray, muscle: int) -> np.ndarray:
        """Predict the envelope of one muscle, shape (n,), from all others; the weights were fitted with it."""
        return self.reconstruct(envelopes, [i for i in range(len(self.muscles)) if i != muscle])[:, muscle]


@dataclass(frozen=True, eq=False)
class SynergyCount:
    """Variance that each number of synergies explains, from 1 to the number of muscles less one."""

    numbers: np.ndarray  # Numbers of synergies, shape (c,)
    fitted: np.ndarray  # VAF of the fitted samples, shape (c,)
    heldout: np.ndarray  # VAF of the held-out samples, reconstructed from all muscles, shape (c,)
    least: np.ndarray  # Held-out VAF of the muscle that is reconstructed worst, shape (c,)
    shuffled: np.ndarray  # Held-out VAF of envelopes shifted apart in time, which is the level of chance, shape (c,)
    left_out: np.ndarray  # R2 of muscles predicted from the others, in turn, on held-out samples, shape (c,)
    errors: np.ndarray  # Their mean square error over the variance, by block of held-out time, shape (blocks, c)

    @property
    def best(self) -> int:
        """Smallest number of synergies whose error on held-out muscles is within one standard error of the minimum."""
        return int(self.numbers[_within_one_error(self.errors)])

    @property
    def interval(self) -> tuple[int, int]:
        """Least and largest number that is chosen on blocks of time drawn with replacement, of the stated interval."""
        rng = np.random.default_rng(SYNERGY_FIT.seed)
        return _drawn_interval([self.draw(rng) for _ in range(SYNERGY_FIT.draw_count)], self.best)

    def draw(self, rng: np.random.Generator) -> int:
        """Return the number that is chosen on blocks of time drawn with replacement."""
        blocks = len(self.errors)
        return int(self.numbers[_within_one_error(self.errors[rng.integers(blocks, size=blocks)])])

    @property
    def predicting(self) -> int:
        """Number with which muscles are best predicted from the others."""
        return int(self.numbers[int(np.argmax(self.left_out))])

    def sentence(self, number: int) -> str:
        """Return how many synergies there are, how sure that is, and what they account for, in a sentence."""
        low, high = self.interval
        often = f"{low}" if low == high else f"{low} to {high}"
        said = f"{number} synerg{'y' if number == 1 else 'ies'} ({often} by bi-cross-validation)"
        if number not in self.numbers:
            return said
        share = 100.0 * float(self.heldout[list(self.numbers).index(number)])
        return f"{said} account{'s' if number == 1 else ''} for {share:.0f} % of the held-out variance"


@dataclass(frozen=True)
class CommonNumber:
    """Number of synergies of several people, with its interval over people and over blocks of their time."""

    number: int
    interval: tuple[int, int]
    people: int


def common_number(people: Sequence[Sequence[SynergyCount]]) -> CommonNumber:
    """Return the median number of synergies of people, each with one count or more, and its interval.

    For the interval, people are drawn with replacement, and blocks of time of each of their counts.
    """
    rng = np.random.default_rng(SYNERGY_FIT.seed)
    number = int(np.median([count.best for own in people for count in own]))
    drawn = []
    for _ in range(SYNERGY_FIT.draw_count):
        chosen = [people[i] for i in rng.integers(len(people), size=len(people))]
        drawn.append(int(np.median([count.draw(rng) for own in chosen for count in own])))
    return CommonNumber(number, _drawn_interval(drawn, number), len(people))


def _drawn_interval(drawn: Sequence[int], number: int) -> tuple[int, int]:
    """Return the interval of drawn numbers, which holds the `number` itself."""
    tail = 0.5 * (1.0 - SYNERGY_FIT.interval)
    low, high = np.quantile(drawn, (tail, 1.0 - tail), method="nearest")
    return min(int(low), number), max(int(high), number)


def _within_one_error(errors: np.ndarray) -> int:
    """Return the place of the smallest number within one standard error of the least error, of (blocks, numbers)."""
    mean = errors.mean(axis=0)
    least = int(np.argmin(mean))
    # The blocks' own levels are common to all numbers: what counts is how surely the least error is less.
    beyond = errors - errors[:, least : least + 1]
    sure = beyond.std(axis=0, ddof=1) / np.sqrt(len(errors)) if len(errors) > 1 else np.zeros(len(mean))
    return int(np.flatnonzero(beyond.mean(axis=0) <= sure)[0])


def find_synergies(
    envelopes: np.ndarray, muscles: Sequence[str], number: int, *, min_muscles: int = SYNERGY_FIT.min_muscles
) -> Synergies:
    """Factor envelopes, shape (n, m) [1], into a `number` of synergies."""
    e = require_envelopes(envelopes, muscles, min_muscles)
    if not 1 <= number <= len(muscles):
        raise IdentificationError(f"synergies: found {number}, expected 1 to {len(muscles)}, as many as muscles")
    activations, weights = nonnegative_factors(e, number, SYNERGY_FIT.max_iterations)
    top = weights.max(axis=1)
    top = np.where(top > 0.0, top, 1.0)
    left = np.mean((e - activations @ weights) ** 2) / np.mean((activations * top) ** 2)
    weights = weights / top[:, None]
    order = np.argsort([int(np.argmax(row)) for row in weights], kind="stable")
    return Synergies(tuple(muscles), weights[order], float(left))


def count_synergies(
    envelopes: np.ndarray,
    time: np.ndarray,
    muscles: Sequence[str],
    heldout: np.ndarray | None = None,
    most: int = 8,
    *,
    min_muscles: int = SYNERGY_FIT.min_muscles,
) -> SynergyCount:
    """Return the variance that each number of synergies explains, up to `most`.

    Envelopes have shape (n, m). The test set is `heldout`, shape (k, m), or without it, blocks of `time`, shape (n,)
    [s], in turn.
    """
    e = require_envelopes(envelopes, muscles, min_muscles)
    if heldout is not None and len(heldout):
        judged = require_envelopes(heldout, muscles, min_muscles)
        parts = [(e, judged)]
    else:
        parts = [
            (e[fitted], e[judged])
            for fitted, judged in block_folds(time, SYNERGY_FIT.block_count, SYNERGY_FIT.fold_gap_s)
        ]
    numbers = np.arange(1, min(most, len(muscles) - 1) + 1)
    edges = np.linspace(0, sum(len(judged) for _, judged in parts), SYNERGY_FIT.block_count + 1).astype(int)
    rows, errors = [], []
    for number in numbers:
        own = [find_synergies(fitted, muscles, int(number), min_muscles=min_muscles) for fitted, _ in parts]
        truth = np.concatenate([judged for _, judged in parts])
        rebuilt = np.concatenate([s.reconstruct(judged) for s, (_, judged) in zip(own, parts, strict=True)])
        filled = np.concatenate(
            [
                np.column_stack([s.predict_muscle(judged, i) for i in range(len(muscles))])
                for s, (_, judged) in zip(own, parts, strict=True)
            ]
        )
        chance = [
            find_synergies(shift_envelopes_apart(fitted), muscles, int(number), min_muscles=min_muscles)
            for fitted, _ in parts
        ]
        apart = [shift_envelopes_apart(judged) for _, judged in parts]
        squares = ((truth - filled) ** 2 / truth.var(axis=0).mean()).mean(axis=1)
        errors.append([float(squares[a:b].mean()) for a, b in pairwise(edges) if b > a])
        rows.append(
            (
                float(np.mean([vaf(fitted, s.reconstruct(fitted)) for s, (fitted, _) in zip(own, parts, strict=True)])),
                vaf(truth, rebuilt),
                min(vaf(truth[:, i], rebuilt[:, i]) for i in range(len(muscles))),
                vaf(
                    np.concatenate(apart),
                    np.concatenate([s.reconstruct(x) for s, x in zip(chance, apart, strict=True)]),
                ),
                r_squared(truth, filled),
            )
        )
    return SynergyCount(numbers, *np.array(rows).T, np.array(errors).T)


def similarity(one: Synergies, other: Synergies) -> tuple[float, np.ndarray]:
    """Return the mean cosine of matched synergies, and the index in `other` that matches each synergy of `one`."""
    from scipy.optimize import linear_sum_assignment

    a, b = (s.weights / np.linalg.norm(s.weights, axis=1, keepdims=True) for s in (one, other))
    cosines = a @ b.T
    rows, columns = linear_sum_assignment(-cosines)
    return float(cosines[rows, columns].mean()), columns


def chance_similarity(one: Synergies, other: Synergies, draws: int = 200, level: float = 0.95) -> float:
    """Return the quantile at `level` of the similarity of `one` to `other` with its weights permuted at random."""
    rng = np.random.default_rng(SYNERGY_FIT.seed)
    found = []
    for _ in range(draws):
        mixed = np.array([rng.permutation(row) for row in other.weights])
        found.append(similarity(one, Synergies(other.muscles, mixed))[0])
    return float(np.quantile(found, level))


def shift_envelopes_apart(envelopes: np.ndarray) -> np.ndarray:
    """Return envelopes, shape (n, m), each rotated in time by another share, so that they no longer share timing."""
    n, m = envelopes.shape
    return np.column_stack([np.roll(envelopes[:, i], round(n * i / m * 0.97)) for i in range(m)])


def vaf(truth: np.ndarray, rebuilt: np.ndarray) -> float:
    """Return the variance accounted for, with variance taken about 0."""
    return float(1.0 - np.sum((truth - rebuilt) ** 2) / np.sum(truth**2))


def r_squared(truth: np.ndarray, predicted: np.ndarray) -> float:
    """Return R2 of `predicted` about the mean of `truth`, both of shape (n,), or of all their columns together."""
    return float(1.0 - np.sum((truth - predicted) ** 2) / np.sum((truth - truth.mean(axis=0)) ** 2))


def solve_non_negative(a: np.ndarray, b: np.ndarray, ridge: float = 0.0) -> np.ndarray:
    """Solve min |A x - b|^2 + ridge |x|^2 with x >= 0 for all columns of b at once, shape (k, n).

    A has shape (m, k), b (m, n). Coordinate descent on the normal equations is exact in the limit.
    """
    gram, right = a.T @ a + ridge * np.eye(a.shape[1]), a.T @ b
    scale = np.diag(gram)
    x = np.zeros_like(right)
    live = np.flatnonzero(scale > 1e-12 * max(float(scale.max(initial=0.0)), 1e-300))
    for _ in range(300):
        most = 0.0
        for i in live:
            new = np.maximum(x[i] + (right[i] - gram[i] @ x) / scale[i], 0.0)
            most = max(most, float(np.max(np.abs(new - x[i]), initial=0.0)))
            x[i] = new
        if most < 1e-7:
            break
    return x


def largest_envelopes(envelopes: np.ndarray) -> np.ndarray:
    """Return what each muscle's envelope is divided by, (m,): its largest value; 1 of one that is 0 throughout.

    A muscle that hardly works would otherwise hardly count.
    """
    top = np.max(envelopes, axis=0)
    return np.where(top > 0.0, top, 1.0)


def require_envelopes(
    envelopes: np.ndarray, muscles: Sequence[str], min_muscles: int = SYNERGY_FIT.min_muscles
) -> np.ndarray:
    """Return envelopes as an array, shape (n, m), or refuse those that cannot be factored."""
    e = np.asarray(envelopes, float)
    if len(muscles) < min_muscles:
        raise IdentificationError(
            f"synergies: found {len(muscles)} muscles ({', '.join(muscles)}), expected at least {min_muscles}: "
            "fewer cannot be grouped"
        )
    if e.ndim != 2 or e.shape[1] != len(muscles):
        raise IdentificationError(f"synergies: found envelopes of shape {e.shape}, expected (n, {len(muscles)})")
    for i, muscle in enumerate(muscles):
        if not np.isfinite(e[:, i]).all():
            first = int(np.flatnonzero(~np.isfinite(e[:, i]))[0])
            raise IdentificationError(
                f"synergies, {muscle}: found missing samples (NaN), the first at index {first}, expected a number in "
                "every sample"
            )
        if np.min(e[:, i]) < 0.0:
            raise IdentificationError(
                f"synergies, {muscle}: found {np.min(e[:, i]):.3g}, expected an envelope, none below 0: rectify raw EMG"
            )
        if not np.any(e[:, i] > 0.0):
            raise IdentificationError(f"synergies, {muscle}: found no activity at all, expected some")
    return e


MIN_MUSCLES = 2
"""Smallest number of muscles. Two muscles have one synergy, their common activation."""


@dataclass(frozen=True, eq=False, repr=False)
class FoundSynergies:
    """Muscle synergies with the evidence for their number.

    Attributes
    ----------
    model : Synergies
        Weights of the muscles in each synergy, and the activations of any envelopes.
    count : SynergyCount
        Variance accounted for by each number of synergies, on samples that were not fitted.
    activations : ndarray, shape (n, number)
        Activation of each synergy in the fitted envelopes.
    """

    model: Synergies
    count: SynergyCount
    activations: np.ndarray = field(repr=False)

    @property
    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles, in the order of the weights' columns."""
        return self.model.muscles

    @property
    def weights(self) -> np.ndarray:
        """Weight of each muscle in each synergy, shape (number, muscles), the largest of a synergy 1."""
        return self.model.weights

    def __len__(self) -> int:
        return len(self.model)

    def to_frame(self):
        """Return the weights as a data frame: a row for each muscle, a column for each synergy; needs pandas."""
        columns = {f"synergy {i + 1}": row for i, row in enumerate(self.weights)}
        return data_frame(columns, self.muscles)

    def _table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        head = ("muscle", *(f"synergy {i + 1}" for i in range(len(self))))
        return head, [(m, *(f"{w:.2f}" for w in row)) for m, row in zip(self.muscles, self.weights.T, strict=True)]

    def _fact(self) -> str:
        return self.count.sentence(len(self))

    def __repr__(self) -> str:
        return f"{self._fact()}\n{text_table(*self._table())}"

    def _repr_html_(self) -> str:
        return html_table(self._fact(), *self._table())


def synergies(
    envelopes: Mapping[str, ArrayLike] | ArrayLike,
    *,
    fs: float,
    muscles: Sequence[str] | None = None,
    number: int | None = None,
    heldout: Mapping[str, ArrayLike] | ArrayLike | None = None,
) -> FoundSynergies:
    """Find muscle synergies in envelopes by non-negative matrix factorisation.

    Parameters
    ----------
    envelopes : mapping of str to array_like, or array_like, shape (n, m)
        Envelopes by muscle, at least two; each is divided by its own largest value, so that muscles count alike.
    fs : float
        Sampling rate [Hz].
    muscles : sequence of str, optional
        Names of the columns, where `envelopes` is an array.
    number : int, optional
        Number of synergies; by default the smallest that predicts each muscle from the others on held-out samples
        as well as any, within one standard error.
    heldout : mapping or array_like, optional
        Envelopes of the same muscles that choose the number; by default, cross-validation over blocks of `envelopes`.

    Returns
    -------
    FoundSynergies
        ``.weights``, ``.activations``, ``.count`` and `to_frame`.

    Raises
    ------
    IdentificationError
        If there are fewer than two muscles or the arrays do not fit together.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> push, pull = np.clip(np.sin(t), 0.0, None), np.clip(-np.sin(t), 0.0, None)
    >>> found = synergies({"a": push, "b": 0.5 * push + 0.1 * pull, "c": pull, "d": 0.8 * pull}, fs=100.0)
    >>> len(found)
    2
    """
    if not fs > 0.0:
        raise IdentificationError(f"synergies: found a sampling rate of {fs:g} Hz, expected one above 0")
    fitted, names = _envelope_table(envelopes, muscles)
    left_out = None if heldout is None else _envelope_table(heldout, names)[0]
    if len(names) < MIN_MUSCLES:
        raise IdentificationError(f"synergies: found {len(names)} muscles, expected at least {MIN_MUSCLES}")
    top = largest_envelopes(require_envelopes(fitted, names, MIN_MUSCLES))
    fitted, left_out = fitted / top, None if left_out is None else left_out / top
    counted = count_synergies(fitted, np.arange(len(fitted)) / fs, names, left_out, min_muscles=MIN_MUSCLES)
    model = find_synergies(fitted, names, counted.best if number is None else number, min_muscles=MIN_MUSCLES)
    return FoundSynergies(model, counted, model.activations(fitted))


def _envelope_table(envelopes, muscles: Sequence[str] | None) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return envelopes as an array, shape (n, m), with the muscles' names."""
    if isinstance(envelopes, Mapping):
        names = tuple(envelopes) if muscles is None else tuple(muscles)
        missing = [name for name in names if name not in envelopes]
        if missing:
            raise IdentificationError(
                f"synergies: found envelopes of {', '.join(map(str, envelopes))}, expected {', '.join(missing)} too"
            )
        lengths = {name: np.shape(envelopes[name]) for name in names}
        if len(set(lengths.values())) > 1:
            raise IdentificationError(f"synergies: found envelopes of shapes {lengths}, expected one shape (n,)")
        return np.column_stack([np.asarray(envelopes[name], float) for name in names]), names
    table = np.asarray(envelopes, float)
    if table.ndim != 2:
        raise IdentificationError(f"synergies: found envelopes of shape {table.shape}, expected (n, muscles)")
    names = tuple(f"muscle {i + 1}" for i in range(table.shape[1])) if muscles is None else tuple(muscles)
    if len(names) != table.shape[1]:
        raise IdentificationError(f"synergies: found {len(names)} names of {table.shape[1]} columns, expected one each")
    return table, names
