"""Muscle synergies from arrays of envelopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import IdentificationError
from ..._tabular import data_frame, html_table, text_table
from .synergies import Synergies, SynergyCount, count_synergies, find_synergies

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
        at = int(np.flatnonzero(self.count.numbers == len(self))[0]) if len(self) in self.count.numbers else None
        if at is None:
            return f"{len(self)} synergies of {len(self.muscles)} muscles"
        return (
            f"{len(self)} synergies account for {100.0 * self.count.heldout[at]:.1f} % of the variance of samples that "
            f"were not fitted"
        )

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
        Envelopes by muscle, each relative to the muscle's own maximum [1], at least two muscles.
    fs : float
        Sampling rate [Hz].
    muscles : sequence of str, optional
        Names of the columns, where `envelopes` is an array.
    number : int, optional
        Number of synergies; by default the smallest that accounts for 90 % of the variance of held-out samples,
        and for 75 % of each muscle's.
    heldout : mapping or array_like, optional
        Envelopes of the same muscles that choose the number; blocks of `envelopes` left out in turn by default.

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
    counted = count_synergies(fitted, np.arange(len(fitted)) / fs, names, left_out, min_muscles=MIN_MUSCLES)
    model = find_synergies(fitted, names, counted.enough if number is None else number, min_muscles=MIN_MUSCLES)
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
        raise IdentificationError(f"synergies: found {len(names)} names for {table.shape[1]} columns, expected as many")
    return table, names
