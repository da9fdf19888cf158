r"""May a robot be called transparent? All end points together, each within its margin.

"Transparent" is claimed only if every end point lies within its margin: an intersection-union test, whose level is
that of each [1]_, so that nothing is divided by the number of end points; power is what many of them cost. "Not
transparent" is claimed if one end point lies beyond its margin; of several tries one may succeed by chance, so their p
are corrected after Holm. Between both the study cannot say, and is told how many participants would.

What is said of an end point may be owed to something else than the condition: to the order of conditions, to what came
before, to movements that were still changing, or to slow ones that gave no value. Each is a `Doubt`: it is tested, and
the change without it is held against the margin too. Where it weighs and the change without it does not say the same,
the end point is undecided. A doubt can thus only take a claim away, never make one. Some weigh always: to reckon only
with what is seen would let through what few people do not show.

What is claimed is an *estimand*, stated before the data: the mean of people's changes, their pseudo-median, or the mean
and with it that at least a declared share of people lies within the margin. No estimand is claimed to lie within where
one person lies far beyond the margin: a mean that is small although somebody is slowed by half misleads its reader.

.. [1] R. L. Berger, J. C. Hsu, "Bioequivalence trials, intersection-union tests and equivalence confidence sets", Stat.
   Sci. 11, 1996.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .._errors import PellucidError
from .comparison import holm
from .curves import CurveComparison
from .equivalence import BEYOND_MARGIN, UNDECIDED, WITHIN_MARGIN, Equivalence, Margin, Method, equivalence

Estimand = Literal["mean", "pseudo-median", "mean and people"]

ESTIMAND_METHODS: dict[Estimand, Method] = {
    "mean": "skew_robust",
    "pseudo-median": "signed_rank",
    "mean and people": "skew_robust",
}
"""Test of each estimand."""

PASS = "transparent"
"""Verdict if every end point lies within its margin."""

FAIL = "not transparent"
"""Verdict if at least one end point lies beyond its margin, after the correction of Holm."""

CANNOT_SAY = "cannot say"
"""Verdict if the data support neither of the other two."""


@dataclass(frozen=True)
class Doubt:
    """Another possible cause of a change, and the equivalence test of the end point without that cause."""

    what: str  # cause: ``"period"``, ``"carry-over"``, ``"learning"`` or ``"left out"``
    p_value: float  # p value of the test that the cause has no effect
    without: Equivalence  # test of the end point with the effect of the cause removed
    always: bool = False  # True: both tests must agree even if the cause is not significant
    never: bool = False  # True: the cause cannot have moved the estimate, and is told for information

    def weighs(self, alpha: float) -> bool:
        """Return whether the doubt counts: its p value is at most `alpha`, or it counts always."""
        return not self.never and (self.always or self.p_value <= alpha)


@dataclass(frozen=True)
class Certificate:
    """Result of the joint test of all end points under one condition."""

    end_points: Mapping[str, Equivalence]
    beyond: Mapping[str, float]  # p values of "beyond the margin" by end point, corrected after Holm
    alpha: float
    doubts: Mapping[str, tuple[Doubt, ...]] = field(default_factory=dict)  # doubts by end point
    curves: Mapping[str, CurveComparison] = field(default_factory=dict)  # curves with margins, judged as end points
    people: float | None = None  # share of people who must be shown to lie within, if declared

    @property
    def p_value(self) -> float:
        """p value of the claim that all end points lie within their margins: the largest single one."""
        return max(each.p_within for each in self._all.values())

    @property
    def _all(self) -> dict[str, Equivalence | CurveComparison]:
        return {**self.end_points, **self.curves}

    @property
    def verdict(self) -> str:
        """``"transparent"``, ``"not transparent"`` or ``"cannot say"``."""
        said = [self.said_of(name) for name in self._all]
        if BEYOND_MARGIN in said:
            return FAIL
        return PASS if set(said) == {WITHIN_MARGIN} else CANNOT_SAY

    def tested(self, name: str) -> str:
        """Return ``"within"``, ``"beyond"`` (corrected after Holm) or ``"undecided"`` by the test of one end point."""
        if self._all[name].p_within <= self.alpha:
            return WITHIN_MARGIN
        return BEYOND_MARGIN if self.beyond[name] <= self.alpha else UNDECIDED

    def contradicted(self, name: str) -> tuple[Doubt, ...]:
        """Return the doubts that count and that contradict the test of an end point.

        Their level is shared among the end points: each kind of doubt arises by chance in at most alpha of studies.
        """
        said = self.tested(name)
        own = self.doubts.get(name, ()) if said != UNDECIDED else ()
        level = self.alpha / len(self.end_points)
        return tuple(doubt for doubt in own if doubt.weighs(level) and doubt.without.verdict != said)

    def far_people(self, name: str) -> tuple[int, ...]:
        """Return the rows of people who lie so far beyond an end point's margin that nothing is claimed within."""
        tested = self.tested(name) == WITHIN_MARGIN and name in self.end_points
        return self.end_points[name].far_people if tested else ()

    def lacks_people(self, name: str) -> bool:
        """Return whether an end point tested within fails to show the declared share of people to lie within."""
        if self.people is None or name not in self.end_points or self.tested(name) != WITHIN_MARGIN:
            return False
        return self.end_points[name].share_within < self.people

    def said_of(self, name: str) -> str:
        """Return the result of one end point's test.

        A doubt that contradicts it, a person far beyond the margin, and a declared share of people that is not shown
        each make it ``"undecided"``.
        """
        taken = self.contradicted(name) or self.far_people(name) or self.lacks_people(name)
        return UNDECIDED if taken else self.tested(name)


def certificate(
    differences: Mapping[str, np.ndarray],
    margins: Mapping[str, Margin],
    *,
    alpha: float = 0.05,
    estimand: Estimand = "mean",
    people: float | None = None,
    method: Method | None = None,
) -> Certificate:
    """Test end points together.

    Parameters
    ----------
    differences : mapping of str to ndarray, shape (n,)
        By end point, one difference a participant, in the unit of its margin.
    margins : mapping of str to Margin
        One for each end point.
    alpha : float
        Chance of a false "transparent" about the estimand.
    estimand : str
        ``"mean"`` of the differences, whatever their skewness; ``"pseudo-median"``, which supposes that they are spread
        symmetrically; or ``"mean and people"``, the mean and a share of `people` within the margin.
    people : float, optional
        Share of people in (0, 1) who must be shown to lie within, for ``"mean and people"``.
    method : str, optional
        Another test in place of the estimand's: ``"t"`` or ``"bootstrap"``, whose level does not hold for skewed
        differences.

    Returns
    -------
    Certificate

    Raises
    ------
    PellucidError
        If there is no end point, one has no margin or no differences, or `people` and `estimand` do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(3)
    >>> changes = {"duration": rng.normal(0.0, 0.04, 16), "vmax": rng.normal(0.02, 0.04, 16)}
    >>> certificate(changes, dict.fromkeys(changes, Margin.of_ratio(0.10))).verdict
    'transparent'
    """
    if not margins:
        raise PellucidError("certificate: found no margin, expected one for each end point")
    lacking = [name for name in margins if name not in differences]
    if lacking:
        raise PellucidError(
            f"certificate: found values of {', '.join(differences) or 'nothing'}, expected those of "
            f"{', '.join(lacking)} too"
        )
    require_people("certificate", estimand, people)
    used: Method = ESTIMAND_METHODS[estimand] if method is None else method
    made = {name: equivalence(differences[name], margin, alpha=alpha, method=used) for name, margin in margins.items()}
    return certificate_from_tests(made, alpha, people=people)


def require_people(where: str, estimand: str, people: float | None) -> None:
    """Refuse an unknown estimand, and a share of people that does not belong to it."""
    if estimand not in ESTIMAND_METHODS:
        raise PellucidError(f"{where}: found the estimand {estimand!r}, expected one of {', '.join(ESTIMAND_METHODS)}")
    if (people is not None) != (estimand == "mean and people"):
        raise PellucidError(
            f'{where}: found people = {people} and the estimand "{estimand}", expected a share with "mean and people" '
            "and none otherwise"
        )
    if people is not None and not 0.0 < people < 1.0:
        raise PellucidError(f"{where}: found people = {people:g}, expected a share above 0 and below 1")


def certificate_from_tests(
    end_points: Mapping[str, Equivalence],
    alpha: float,
    doubts: Mapping[str, tuple[Doubt, ...]] | None = None,
    curves: Mapping[str, CurveComparison] | None = None,
    people: float | None = None,
) -> Certificate:
    """Return the certificate of end points and curves that were tested already, each at level `alpha`.

    `doubts` holds the other possible causes of each end point's change; `people` is the declared share of people.
    """
    every: dict[str, Equivalence | CurveComparison] = {**end_points, **(curves or {})}
    beyond = dict(zip(every, holm([each.p_beyond for each in every.values()]), strict=True))
    return Certificate(end_points, beyond, alpha, doubts or {}, curves or {}, people)
