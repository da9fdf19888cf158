r"""Muscle synergies: a few groups of muscles, each with one activation over time, that reconstruct all envelopes.

Envelopes E (n samples, m muscles), each relative to its own maximum, are factored by scikit-learn into non-negative
activations H and weights W of k synergies [1]_ [2]_,

.. math::
   E \approx H W, \qquad \mathrm{VAF} = 1 - \frac{\sum (E - H W)^2}{\sum E^2}.

The number of synergies is chosen on held-out samples. With fixed weights, more synergies always reconstruct more of
them. The number is therefore the smallest whose VAF reaches a stated threshold, over all muscles and of each [3]_. A
harder test is to predict a muscle that is left out [4]_: the activations of held-out samples are found from the other
muscles alone. This test has an optimal k. It is also how a muscle without an electrode is filled in. If the recorded
muscles hardly determine the activation of a synergy, a ridge limits it: the variance of the error over that of H.

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

from ..._errors import IdentificationError
from .cross_validation import block_folds

FACTORISATION_SEED = 19990
"""Seed of the factorisation, and of random draws of weights."""

MAX_FACTORISATION_ITERATIONS = 500
"""Largest number of iterations of the factorisation."""

DEFAULT_MIN_MUSCLES = 3
"""Smallest number of muscles by default. Two muscles have a single synergy, their common activation."""

VAF_THRESHOLD = 0.9
"""The number of synergies is the smallest whose held-out variance accounted for reaches this share [3]_."""

MIN_MUSCLE_VAF = 0.75
"""Every muscle's held-out variance accounted for must reach this share, too [3]_: large ones could carry the rest."""

BLOCK_COUNT = 5
"""Number of blocks of time that are left out in turn if there is no held-out recording.

Chosen by judgement; no measurement is recorded.
"""

FOLD_GAP_S = 0.2
"""Gap between fitted and test samples [s]. Chosen by judgement; no measurement is recorded."""


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

    @property
    def enough(self) -> int:
        """Smallest number whose held-out VAF reaches `VAF_THRESHOLD`, and each muscle's `MIN_MUSCLE_VAF`.

        It is the largest number if none does.
        """
        reached = np.flatnonzero((self.heldout >= VAF_THRESHOLD) & (self.least >= MIN_MUSCLE_VAF))
        return int(self.numbers[reached[0]] if reached.size else self.numbers[-1])

    @property
    def predicting(self) -> int:
        """Number with which muscles are best predicted from the others."""
        return int(self.numbers[int(np.argmax(self.left_out))])


def find_synergies(
    envelopes: np.ndarray, muscles: Sequence[str], number: int, *, min_muscles: int = DEFAULT_MIN_MUSCLES
) -> Synergies:
    """Factor envelopes, shape (n, m) [1], into a `number` of synergies."""
    from sklearn.decomposition import NMF
    from sklearn.exceptions import ConvergenceWarning

    e = require_envelopes(envelopes, muscles, min_muscles)
    if not 1 <= number <= len(muscles):
        raise IdentificationError(f"synergies: found {number}, expected 1 to {len(muscles)}, as many as muscles")
    model = NMF(
        number,
        init="nndsvda",
        solver="cd",
        max_iter=MAX_FACTORISATION_ITERATIONS,
        tol=1e-4,
        random_state=FACTORISATION_SEED,
    )
    with warnings.catch_warnings():
        # The factors then hardly change any more. Their last digits do not matter.
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
    min_muscles: int = DEFAULT_MIN_MUSCLES,
) -> SynergyCount:
    """Return the variance that each number of synergies explains, up to `most`.

    Envelopes have shape (n, m). The test set is `heldout`, shape (k, m), or without it, blocks of `time`, shape (n,)
    [s], in turn.
    """
    e = require_envelopes(envelopes, muscles, min_muscles)
    if heldout is not None and len(heldout):
        parts = [(e, require_envelopes(heldout, muscles, min_muscles))]
    else:
        parts = [(e[fitted], e[judged]) for fitted, judged in block_folds(time, BLOCK_COUNT, FOLD_GAP_S)]
    numbers = np.arange(1, min(most, len(muscles) - 1) + 1)
    rows = []
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
    return SynergyCount(numbers, *np.array(rows).T)


def similarity(one: Synergies, other: Synergies) -> tuple[float, np.ndarray]:
    """Return the mean cosine of matched synergies, and the index in `other` that matches each synergy of `one`."""
    from scipy.optimize import linear_sum_assignment

    a, b = (s.weights / np.linalg.norm(s.weights, axis=1, keepdims=True) for s in (one, other))
    cosines = a @ b.T
    rows, columns = linear_sum_assignment(-cosines)
    return float(cosines[rows, columns].mean()), columns


def chance_similarity(one: Synergies, other: Synergies, draws: int = 200, level: float = 0.95) -> float:
    """Return the quantile at `level` of the similarity of `one` to `other` with its weights permuted at random."""
    rng = np.random.default_rng(FACTORISATION_SEED)
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


def require_envelopes(
    envelopes: np.ndarray, muscles: Sequence[str], min_muscles: int = DEFAULT_MIN_MUSCLES
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
