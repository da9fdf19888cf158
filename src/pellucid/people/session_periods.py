r"""Periods of ordered sessions: the change of a condition without the effect of the period, and bounds of carry-over.

Each participant's difference, compared condition less control, is modelled as

.. math::
   d_i = \tau + x_i^T \pi + \lambda_{before(compared)} - \lambda_{before(control)} + e_i

where :math:`x_i` says in which periods both conditions came, :math:`\pi` are the effects of the periods, and
:math:`\lambda_j` is what condition j leaves behind for the next session, over what control leaves. Least squares
without :math:`\lambda` estimates :math:`\tau`. For two conditions (AB/BA) this is the mean of both sequences' means
[1]_; for more, each period has an effect of its own, as in the analysis of Williams' designs [2]_.

A carry-over of at most c moves the estimate by at most :math:`c \sum_j |w^T z_j|`: w are the weights of the
participants in the estimate, and :math:`z_j` is 1 where condition j came just before the compared one, and -1 where it
came just before control.

.. [1] M. Hills, P. Armitage, "The two-period cross-over clinical trial", Br. J. Clin. Pharmacol. 8, 1979.
.. [2] B. Jones, M. G. Kenward, "Design and Analysis of Cross-Over Trials", 3rd ed., 2014, ch. 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._errors import PellucidError

MIN_ORDERED_PEOPLE = 4
"""Fewest people of whom the effect of a period is estimated."""

RANK_TOLERANCE = 1e-9
"""A column of periods counts as a combination of others if less than this share of it remains."""


@dataclass(frozen=True, eq=False)
class SessionPeriods:
    """When n people had the compared condition and the control.

    Attributes
    ----------
    contrasts : ndarray, shape (n, q)
        Effect of each period on people's differences.
    carried : ndarray, shape (n, j)
        Effect on people's differences of what each condition but control leaves behind.
    """

    contrasts: np.ndarray
    carried: np.ndarray

    @classmethod
    def of_two(cls, later: np.ndarray) -> SessionPeriods:
        """Return the periods of two conditions; `later`, (n,), is by how many periods the compared one came later.

        >>> SessionPeriods.of_two(np.array([1.0, -1.0])).carried.tolist()
        [[0.0], [-1.0]]
        """
        after = np.asarray(later, float)
        if after.ndim != 1 or not np.isfinite(after).all():
            raise PellucidError(f"periods: found an array of shape {after.shape}, expected (n,) finite numbers")
        return cls(after[:, None], -(after < 0.0).astype(float)[:, None])

    @classmethod
    def of_conditions(cls, periods: np.ndarray, control: int, compared: int) -> SessionPeriods:
        """Return those of two columns of `periods`, (n, k), the times of all conditions of each participant."""
        periods = np.asarray(periods, float)
        n, k = periods.shape
        place = np.argsort(np.argsort(periods, axis=1, kind="stable"), axis=1)
        levels = np.arange(1, k)
        contrasts = (place[:, [compared]] == levels).astype(float) - (place[:, [control]] == levels)
        before = np.full((n, k), -1)
        order = np.argsort(place, axis=1)
        np.put_along_axis(before, order[:, 1:], order[:, :-1], axis=1)
        others = np.array([j for j in range(k) if j != control])
        carried = (before[:, [compared]] == others).astype(float) - (before[:, [control]] == others)
        return cls(contrasts, carried)

    @property
    def key(self) -> tuple:
        """The periods without who had them: studies with equal keys have equal reference distributions."""
        return tuple(sorted(map(tuple, self.contrasts.tolist())))


@dataclass(frozen=True, eq=False)
class Adjustment:
    """The estimate of a change from n people: its weights, and how it widens their differences."""

    basis: np.ndarray  # (n, q) columns about their mean, of the periods whose effects can be estimated
    weights: np.ndarray  # (n,) weights of people's differences in the estimate; their sum is 1
    degrees: int  # degrees of freedom of the residuals
    carry_over_share: float  # change of the estimate by a carry-over of 1, at most

    @property
    def people(self) -> float:
        """Number of people whose plain mean has the variance of the estimate."""
        return 1.0 / float(self.weights @ self.weights)

    @property
    def is_plain(self) -> bool:
        """Whether the estimate is the mean of the differences as they are."""
        return self.basis.shape[1] == 0

    def adjusted(self, differences: np.ndarray) -> np.ndarray:
        """Return people's differences (..., n) without the effects of the periods."""
        if self.is_plain:
            return differences
        estimate = differences @ self.weights
        rest = differences - differences.mean(axis=-1, keepdims=True)
        rest = rest - (rest @ self.basis) @ self.basis.T
        return estimate[..., None] + rest

    def widened(self, adjusted: np.ndarray) -> np.ndarray:
        """Return adjusted differences about their mean, widened so that its standard error is that of least squares."""
        if self.is_plain:
            return adjusted
        n = adjusted.shape[-1]
        middle = adjusted.mean(axis=-1, keepdims=True)
        return middle + np.sqrt(n / self.people * (n - 1.0) / self.degrees) * (adjusted - middle)


def adjustment(people: int, sessions: SessionPeriods | None, *, known: bool = True) -> Adjustment:
    """Return the estimate's adjustment for the periods of a number of `people`.

    Differences stay as they are where the effects of periods cannot be told from the change, and where differences are
    not `known`, but for bounds.
    """
    plain = np.full(people, 1.0 / people)
    if sessions is None:
        return Adjustment(np.empty((people, 0)), plain, people - 1, 0.0)
    if len(sessions.contrasts) != people:
        raise PellucidError(f"periods: found periods of {len(sessions.contrasts)} participants, expected {people}")
    columns = sessions.contrasts
    centred = columns - columns.mean(axis=0)
    left, size, _ = np.linalg.svd(centred, full_matrices=False)
    rank = int(np.sum(size > RANK_TOLERANCE * max(1.0, float(np.abs(columns).max(initial=0.0)))))
    basis, weights = left[:, :rank], plain
    # The change itself must be no combination of the effects of periods: some weights must cancel every period.
    whole = np.column_stack([np.ones(people), columns])
    solved = np.linalg.pinv(whole)[0]
    estimable = bool(np.allclose(solved @ columns, 0.0, atol=1e-8) and np.isclose(solved.sum(), 1.0))
    if known and rank and estimable and people >= max(MIN_ORDERED_PEOPLE, rank + 3):
        weights = solved
    else:
        basis = np.empty((people, 0))
    moved = float(np.abs(weights @ sessions.carried).sum())
    return Adjustment(basis, weights, people - 1 - basis.shape[1], moved)
