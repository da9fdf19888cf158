"""Certify from arrays or a table: does a robot change its wearers' movements by less than stated margins?"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._errors import PellucidError
from ..numerics.arguments import with_checked_arguments
from .analysis import Analysis, Estimand, keywords_beside
from .assess_table import assess_table
from .certificate import Certificate, PeoplesChanges, decide
from .equivalence import DEFAULT_CARRY_OVER
from .session_periods import SessionPeriods
from .share_of_people import DEFAULT_RULE


@with_checked_arguments
def certify(
    values: Mapping[str, tuple[ArrayLike, ArrayLike]] | object,
    margins: Mapping[str, float | tuple[float, float]] | None = None,
    *,
    analysis: Analysis | Mapping[str, Any] | str | os.PathLike[str] | None = None,
    compared: str | None = None,
    relative: bool = True,
    alpha: float = 0.05,
    estimand: Estimand = "mean",
    people: float | None = None,
    people_level: float = DEFAULT_RULE.alpha,
    later: ArrayLike | None = None,
    largest_carry_over: float = DEFAULT_CARRY_OVER,
) -> Certificate:
    """Test whether a robot changes its wearers' movements by less than margins that were stated beforehand.

    The null hypothesis is that at least one index changes by its margin or more (two one-sided tests for each index,
    joined by the intersection-union principle). What changes is the estimand. The test of the mean holds its level for
    skewed changes; that of the pseudo-median supposes symmetry. "Transparent" also needs two shares of people to be
    shown: at least 75 % within each margin, and at most 5 % beyond three margins. It is never said with fewer than 12
    participants.

    Parameters
    ----------
    values : mapping of str to tuple of array_like, shape (n,), or data frame
        For each index the participants' values without and with the robot, in the same order. With `analysis` a table
        as `assess` takes it, with one row for each movement: losses, periods, learning and exclusions are then checked.
    margins : mapping of str to float or tuple of float
        For each index the largest change that does not matter: a share such as 0.1, up or down by as large a factor,
        or the lowest and highest change in the index's unit (with ``relative=False``). An index of `assess` whose
        decrease is never worse, such as ``"end_absolute"``, has an upper end only.
    analysis : Analysis, mapping, or path-like, optional
        What was stated before the data were seen: an object, its mapping, ``analysis.toml``, or study.toml with
        ``[assessment]``. It takes the place of all other keywords but `compared`.
    compared : str, optional
        Condition that is certified against control, where a table has several.
    relative : bool
        Whether changes are ratios, with the robot over without; otherwise differences.
    alpha : float
        Probability of a false "transparent" about the estimand.
    estimand : {"mean", "pseudo-median", "mean and people"}
        What must lie within the margins: the mean of participants' changes, their pseudo-median, or the mean with
        another share of `people` than 75 %.
    people : float, optional
        Share of people in (0, 1) who must be shown to lie within the margin, for ``"mean and people"``.
    people_level : float
        Level of the tests of both shares of people.
    later : array_like, shape (n,), optional
        By how many periods each participant's session with the robot came after the one without it, such as 1 and -1
        in a cross-over study. The effect of the period is then taken out of the estimate.
    largest_carry_over : float
        Largest effect of one session on the next, as a share of the margin, for which the verdict holds; 0 assumes
        none. It matters only with `later`.

    Returns
    -------
    Certificate
        ``.verdict`` is "transparent", "not transparent" or "cannot say".

    Raises
    ------
    PellucidError
        If shapes differ, a value is missing, or ratios are asked for of values that are not positive.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> rng = np.random.default_rng(0)
    >>> free = rng.normal(1.0, 0.1, 16)
    >>> worn = free * np.exp(rng.normal(0.0, 0.03, 16))
    >>> found = pl.certify({"duration": (free, worn)}, {"duration": 0.10})
    >>> found.verdict, found.people_answer("duration")
    ('transparent', 'shown')

    A table by a registered analysis, of which a file could take the place:

    >>> people = [f"P{k}" for k in range(16)]
    >>> table = {
    ...     "participant": people * 2,
    ...     "condition": ["free"] * 16 + ["worn"] * 16,
    ...     "period": [1 + k % 2 for k in range(16)] + [2 - k % 2 for k in range(16)],
    ...     "duration": [*free, *worn],
    ... }
    >>> stated = {"control": "free", "design": "AB/BA", "period": "period", "margins": {"duration": "10 %"}}
    >>> pl.certify(table, analysis=stated).verdict
    'transparent'
    """
    if analysis is not None:
        given = {
            "margins": margins, "relative": relative, "alpha": alpha, "estimand": estimand, "people": people,
            "people_level": people_level, "later": later, "largest_carry_over": largest_carry_over,
        }  # fmt: skip
        if keywords_beside(certify, given):
            raise PellucidError("certify: found analysis and other keywords, expected only analysis, which states them")
        return _of_table(values, Analysis.of(analysis), compared)
    if not isinstance(values, Mapping) or not margins:
        raise PellucidError(
            "certify: found no margins, expected one for each index, or analysis= with a table of movements"
        )
    stated = Analysis(
        margins=margins, estimand=estimand, people=people, people_level=people_level, false_transparent=alpha,
        largest_carry_over=largest_carry_over, relative=relative, where="certify",
    )  # fmt: skip
    changes, ends = {}, stated.end_points()
    sessions = None if later is None else SessionPeriods.of_two(np.asarray(later, float))
    for name in margins:
        if name not in values:
            raise PellucidError(
                f"certify: found values of {', '.join(values) or 'nothing'}, expected those of {name} too"
            )
    for name, end in ends.items():
        try:
            free, worn = (np.asarray(x, float) for x in values[name])
        except (TypeError, ValueError):
            raise PellucidError(
                f"certify, {name}: found no two arrays of numbers, expected values without and with the robot"
            ) from None
        if free.shape != worn.shape or free.ndim != 1:
            raise PellucidError(f"certify, {name}: found shapes {free.shape} and {worn.shape}, expected both (n,)")
        if not (np.isfinite(free).all() and np.isfinite(worn).all()):
            raise PellucidError(f"certify, {name}: found missing values (NaN), expected one of each participant")
        if end.ratio and (np.min(free) <= 0.0 or np.min(worn) <= 0.0):
            raise PellucidError(
                f"certify, {name}: found values of 0 or less, expected positive ones for ratios; "
                "relative=False compares differences"
            )
        if sessions is not None and len(sessions.contrasts) != len(free):
            raise PellucidError(
                f"certify, {name}: found later for {len(sessions.contrasts)} participants, expected one value for each "
                f"of the {len(free)}"
            )
        changes[name] = PeoplesChanges(end.margin, end.differences(worn, free), sessions=sessions)
    return decide(stated, changes, points=ends)


def _of_table(table: object, stated: Analysis, compared: str | None) -> Certificate:
    """Return the certificate of a table's compared condition."""
    if not stated.margins:
        raise PellucidError(f"{stated.where}: found no margins, expected one for each index that is certified")
    found = assess_table(table, analysis=stated).certificates
    if compared is None and len(found) > 1:
        raise PellucidError(f"certify: found the conditions {', '.join(found)}, expected compared=NAME of one of them")
    name = next(iter(found)) if compared is None else compared
    if name not in found:
        raise PellucidError(f"certify: found compared = {name!r}, expected one of {', '.join(found)}")
    return found[name]
