r"""Muscle synergies: a few groups of muscles, each with one activation over time, that make all envelopes.

Envelopes E (n samples, m muscles), each over its own largest, are factored into non-negative activations H and weights
W of k synergies [1]_ [2]_, by scikit-learn,

.. math::
   E \approx H W, \qquad \mathrm{VAF} = 1 - \frac{\sum (E - H W)^2}{\sum E^2}.

How many there are is asked of samples that were not fitted. With weights kept, more synergies always rebuild more of
them, so that their VAF has to reach a stated share [3]_. An entry that its own row did not help to rebuild is a harder
question [4]_: the activations of samples left out are found from the other muscles alone, and must tell the muscle left
out. That has a best k; it is also how a muscle without an electrode is filled in. Muscles that are seen may tell little
of a synergy: its activation is then held to its size while fitting, by a ridge of the error's variance over that of H.

.. [1] D. D. Lee, H. S. Seung, "Learning the parts of objects by non-negative matrix factorization", Nature 401, 1999.
.. [2] A. d'Avella, P. Saltiel, E. Bizzi, "Combinations of muscle synergies in the construction of a natural motor
   behavior", Nature Neuroscience 6, 2003.
.. [3] G. Torres-Oviedo, L. H. Ting, "Muscle synergies characterizing human postural responses", J. Neurophysiology 98,
   2007.
.. [4] A. B. Owen, P. O. Perry, "Bi-cross-validation of the SVD and the nonnegative matrix factorization", Annals of
   Applied Statistics 3, 2009.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._errors import IdentificationError
from .cross_validation import block_folds

SEED = 19990
"""Of the factorisation's start, where it draws one."""

SWEEPS = 500
"""Of the factorisation, at most."""

FEWEST = 3
"""Muscles that synergies can be found of."""

ENOUGH = 0.9
"""Variance accounted for that says how many synergies there are."""

FOLDS = 5
"""Blocks of time that are left out in turn where nothing is held out."""

GAP = 0.2
"""Between what is fitted and what judges [s]."""


@dataclass(frozen=True, eq=False)
class Synergies:
    """Groups of muscles."""

    muscles: tuple[str, ...]
    weights: np.ndarray  # (k, m) Of each muscle, the largest of a synergy 1
    ridge: float = 0.0  # Variance of what they leave of an envelope, over that of their activations

    def __len__(self) -> int:
        return len(self.weights)

    def activations(self, envelopes: np.ndarray, seen: Sequence[int] | None = None) -> np.ndarray:
        """How active each synergy is, (n, k), from envelopes (n, m); from the muscles `seen` alone if given."""
        columns = list(range(len(self.muscles)) if seen is None else seen)
        return non_negative(self.weights[:, columns].T, np.asarray(envelopes, float)[:, columns].T, self.ridge).T

    def rebuilt(self, envelopes: np.ndarray, seen: Sequence[int] | None = None) -> np.ndarray:
        """All envelopes, (n, m), as the synergies make them of those that are `seen`."""
        return self.activations(envelopes, seen) @ self.weights

    def filled(self, envelopes: np.ndarray, muscle: int) -> np.ndarray:
        """Envelope of one muscle, (n,), from all others, by the weights that were fitted with it."""
        return self.rebuilt(envelopes, [i for i in range(len(self.muscles)) if i != muscle])[:, muscle]


@dataclass(frozen=True, eq=False)
class SynergyCount:
    """What each number of synergies explains, 1 to as many as there are muscles less one."""

    numbers: np.ndarray  # (c,)
    fitted: np.ndarray  # (c,) VAF of what was fitted
    heldout: np.ndarray  # (c,) Of what was not, from all its muscles
    least: np.ndarray  # (c,) The same of the muscle rebuilt worst
    shuffled: np.ndarray  # (c,) The same as heldout of envelopes shifted apart in time: what chance explains
    left_out: np.ndarray  # (c,) R2 of muscles told from the others, in turn, samples held out

    @property
    def enough(self) -> int:
        """The smallest number whose held-out VAF is `ENOUGH`; the largest where none is."""
        reached = np.flatnonzero(self.heldout >= ENOUGH)
        return int(self.numbers[reached[0]] if reached.size else self.numbers[-1])

    @property
    def predicting(self) -> int:
        """The number that tells a muscle left out best."""
        return int(self.numbers[int(np.argmax(self.left_out))])


def find_synergies(
    envelopes: np.ndarray, muscles: Sequence[str], number: int, *, min_muscles: int = FEWEST
) -> Synergies:
    """Factor envelopes, (n, m) [1], into a `number` of synergies."""
    from sklearn.decomposition import NMF
    from sklearn.exceptions import ConvergenceWarning

    e = require_envelopes(envelopes, muscles, min_muscles)
    if not 1 <= number <= len(muscles):
        raise IdentificationError(f"synergies: found {number}, expected 1 to {len(muscles)}, as many as muscles")
    model = NMF(number, init="nndsvda", solver="cd", max_iter=SWEEPS, tol=1e-4, random_state=SEED)
    with warnings.catch_warnings():
        # The last digits of a factor that hardly changes any more are nobody's question.
        warnings.simplefilter("ignore", ConvergenceWarning)
        activations = model.fit_transform(e)
    weights = model.components_
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
    min_muscles: int = FEWEST,
) -> SynergyCount:
    """What each number of synergies explains of envelopes (n, m) that were not fitted: those `heldout`, (k, m), or
    where there are none blocks of `time`, (n,) [s], in turn."""
    e = require_envelopes(envelopes, muscles, min_muscles)
    if heldout is not None and len(heldout):
        parts = [(e, require_envelopes(heldout, muscles, min_muscles))]
    else:
        parts = [(e[fitted], e[judged]) for fitted, judged in block_folds(time, FOLDS, GAP)]
    numbers = np.arange(1, min(most, len(muscles) - 1) + 1)
    rows = []
    for number in numbers:
        own = [find_synergies(fitted, muscles, int(number), min_muscles=min_muscles) for fitted, _ in parts]
        truth = np.concatenate([judged for _, judged in parts])
        rebuilt = np.concatenate([s.rebuilt(judged) for s, (_, judged) in zip(own, parts, strict=True)])
        filled = np.concatenate(
            [
                np.column_stack([s.filled(judged, i) for i in range(len(muscles))])
                for s, (_, judged) in zip(own, parts, strict=True)
            ]
        )
        chance = [find_synergies(shifted(fitted), muscles, int(number), min_muscles=min_muscles) for fitted, _ in parts]
        apart = [shifted(judged) for _, judged in parts]
        rows.append(
            (
                float(np.mean([vaf(fitted, s.rebuilt(fitted)) for s, (fitted, _) in zip(own, parts, strict=True)])),
                vaf(truth, rebuilt),
                min(vaf(truth[:, i], rebuilt[:, i]) for i in range(len(muscles))),
                vaf(np.concatenate(apart), np.concatenate([s.rebuilt(x) for s, x in zip(chance, apart, strict=True)])),
                determined(truth, filled),
            )
        )
    return SynergyCount(numbers, *np.array(rows).T)


def similarity(one: Synergies, other: Synergies) -> tuple[float, np.ndarray]:
    """Mean cosine of the synergies of two that belong together, and which of the `other`'s each of the first is."""
    from scipy.optimize import linear_sum_assignment

    a, b = (s.weights / np.linalg.norm(s.weights, axis=1, keepdims=True) for s in (one, other))
    cosines = a @ b.T
    rows, columns = linear_sum_assignment(-cosines)
    return float(cosines[rows, columns].mean()), columns


def chance_similarity(one: Synergies, other: Synergies, draws: int = 200, level: float = 0.95) -> float:
    """Similarity that groups of the same weights, of muscles drawn at random, exceed once in 1 / (1 - level)."""
    rng = np.random.default_rng(SEED)
    found = []
    for _ in range(draws):
        mixed = np.array([rng.permutation(row) for row in other.weights])
        found.append(similarity(one, Synergies(other.muscles, mixed))[0])
    return float(np.quantile(found, level))


def shifted(envelopes: np.ndarray) -> np.ndarray:
    """Envelopes, (n, m), each moved round by another share of the whole: what they have in common is gone."""
    n, m = envelopes.shape
    return np.column_stack([np.roll(envelopes[:, i], round(n * i / m * 0.97)) for i in range(m)])


def vaf(truth: np.ndarray, rebuilt: np.ndarray) -> float:
    """Variance accounted for, about 0."""
    return float(1.0 - np.sum((truth - rebuilt) ** 2) / np.sum(truth**2))


def determined(truth: np.ndarray, told: np.ndarray) -> float:
    """R2 of `told`, about the mean of `truth`, both (n,), or of all their columns together."""
    return float(1.0 - np.sum((truth - told) ** 2) / np.sum((truth - truth.mean(axis=0)) ** 2))


def non_negative(a: np.ndarray, b: np.ndarray, ridge: float = 0.0) -> np.ndarray:
    """Least squares with no negative unknown, all columns at once: min |A x - b|^2 + ridge |x|^2, A (m, k), b (m, n),
    gives (k, n).

    Coordinate by coordinate on the normal equations, exact in the limit and the same for every column.
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


def require_envelopes(envelopes: np.ndarray, muscles: Sequence[str], min_muscles: int = FEWEST) -> np.ndarray:
    """Envelopes, (n, m), as they may be factored; an error that says why not."""
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
