"""A certificate of transparency from arrays of participants' values."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from .._errors import PellucidError
from .certificate import Certificate, Estimand, certificate
from .equivalence import Margin
from .indices import INDICES, PercentOf, Worse


def certify(
    values: Mapping[str, tuple[ArrayLike, ArrayLike]],
    margins: Mapping[str, float | tuple[float, float]],
    *,
    relative: bool = True,
    alpha: float = 0.05,
    estimand: Estimand = "mean",
    people: float | None = None,
) -> Certificate:
    """Test whether a robot changes its wearers' movements by less than margins that were stated beforehand.

    The null hypothesis is that at least one index changes by its margin or more (two one-sided tests for each index,
    joined by the intersection-union principle). What changes is the estimand. The test of the mean holds its level for
    skewed changes and claims nothing with fewer than 12 participants; that of the pseudo-median supposes symmetry. With
    one participant far beyond a margin the verdict is never "transparent".

    Parameters
    ----------
    values : mapping of str to tuple of array_like, shape (n,)
        For each index the participants' values without and with the robot, in the same order.
    margins : mapping of str to float or tuple of float
        For each index the largest change that does not matter: a share such as 0.1, up or down by as large a factor,
        or the lowest and highest change in the index's unit (with ``relative=False``). An index of `assess` whose
        decrease is never worse, such as ``"end_absolute"``, has an upper end only.
    relative : bool
        Whether changes are ratios, with the robot over without; otherwise differences.
    alpha : float
        Probability of a false "transparent" about the estimand.
    estimand : {"mean", "pseudo-median", "mean and people"}
        What must lie within the margins: the mean of participants' changes, their pseudo-median, or the mean and with
        it a share of `people`.
    people : float, optional
        Share of people in (0, 1) who must be shown to lie within the margin, for ``"mean and people"``.

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
    >>> found.verdict, round(found.end_points["duration"].share_within, 2)
    ('transparent', 0.83)
    """
    changes, limits = {}, {}
    for name, margin in margins.items():
        if name not in values:
            raise PellucidError(
                f"certify: found values of {', '.join(values) or 'nothing'}, expected those of {name} too"
            )
        limits[name] = margin_of(name, margin, relative)
        free, worn = (np.asarray(x, float) for x in values[name])
        if free.shape != worn.shape or free.ndim != 1:
            raise PellucidError(f"certify, {name}: found shapes {free.shape} and {worn.shape}, expected both (n,)")
        if not (np.isfinite(free).all() and np.isfinite(worn).all()):
            raise PellucidError(f"certify, {name}: found missing values (NaN), expected one of each participant")
        if relative and (np.min(free) <= 0.0 or np.min(worn) <= 0.0):
            raise PellucidError(
                f"certify, {name}: found values of 0 or less, expected positive ones for ratios; "
                "relative=False compares differences"
            )
        changes[name] = np.log(worn / free) if relative else worn - free
    return certificate(changes, limits, alpha=alpha, estimand=estimand, people=people)


def margin_of(name: str, margin: float | tuple[float, float], relative: bool = True) -> Margin:
    """Return the margin of an index, a share or its two ends; for logarithms of ratios if `relative`.

    An index of the catalogue whose decrease is never worse has an upper end only, and one without a zero no share.
    """
    index = INDICES.get(name)
    if relative and index is not None and index.percent_of is PercentOf.NOTHING_AT_ALL:
        raise PellucidError(f"certify, {name}: found a share, expected a change in {index.unit}: it has no zero")
    if isinstance(margin, (int, float)):
        if not margin > 0.0:
            raise PellucidError(f"certify, {name}: found the margin {margin:g}, expected one above 0")
        made = Margin.of_ratio(float(margin)) if relative else Margin.either_way(float(margin))
        return Margin(-inf, made.high) if index is not None and index.worse is Worse.IF_MORE else made
    low, high = (float(end) for end in margin)
    return Margin(float(np.log1p(low)), float(np.log1p(high))) if relative else Margin(low, high)
