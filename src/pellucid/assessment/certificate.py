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

.. [1] R. L. Berger, J. C. Hsu, "Bioequivalence trials, intersection-union tests and equivalence confidence sets", Stat.
   Sci. 11, 1996.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from .._errors import PellucidError
from .comparison import holm
from .curves import CurveComparison
from .equivalence import BEYOND_MARGIN, UNDECIDED, WITHIN_MARGIN, Equivalence, Margin, Method, equivalence

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

    def weighs(self, alpha: float) -> bool:
        """Return whether the doubt counts: its p value is at most `alpha`, uncorrected, or it counts always."""
        return self.always or self.p_value <= alpha


@dataclass(frozen=True)
class Certificate:
    """Result of the joint test of all end points under one condition."""

    end_points: Mapping[str, Equivalence]
    beyond: Mapping[str, float]  # p values of "beyond the margin" by end point, corrected after Holm
    alpha: float
    doubts: Mapping[str, tuple[Doubt, ...]] = field(default_factory=dict)  # doubts by end point
    curves: Mapping[str, CurveComparison] = field(default_factory=dict)  # curves with margins, judged as end points

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
        """Return the doubts that count and that contradict the test of an end point."""
        said = self.tested(name)
        own = self.doubts.get(name, ()) if said != UNDECIDED else ()
        return tuple(doubt for doubt in own if doubt.weighs(self.alpha) and doubt.without.verdict != said)

    def said_of(self, name: str) -> str:
        """Return the result of one end point's test; a doubt that contradicts it makes it ``"undecided"``."""
        return UNDECIDED if self.contradicted(name) else self.tested(name)


def certificate(
    differences: Mapping[str, np.ndarray],
    margins: Mapping[str, Margin],
    *,
    alpha: float = 0.05,
    method: Method = "signed_rank",
) -> Certificate:
    """Test end points together.

    Parameters
    ----------
    differences : mapping of str to ndarray, shape (n,)
        By end point, one difference a participant, in the unit of its margin.
    margins : mapping of str to Margin
        One for each end point.
    alpha : float
        Chance of a false "transparent". By signed ranks it holds for the pseudo-median of differences that are spread
        symmetrically, by the other methods for the mean; a skewed distribution makes the chance for the mean larger.
    method : str
        ``"signed_rank"``, ``"t"`` or ``"bootstrap"``.

    Returns
    -------
    Certificate

    Raises
    ------
    PellucidError
        If there is no end point, one has no margin or no differences.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(3)
    >>> changes = {"duration": rng.normal(0.0, 0.04, 12), "vmax": rng.normal(0.02, 0.04, 12)}
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
    made = {
        name: equivalence(differences[name], margin, alpha=alpha, method=method) for name, margin in margins.items()
    }
    return certificate_from_tests(made, alpha)


def certificate_from_tests(
    end_points: Mapping[str, Equivalence],
    alpha: float,
    doubts: Mapping[str, tuple[Doubt, ...]] | None = None,
    curves: Mapping[str, CurveComparison] | None = None,
) -> Certificate:
    """Return the certificate of end points and curves that were tested already, each at level `alpha`.

    `doubts` holds the other possible causes of each end point's change.
    """
    every: dict[str, Equivalence | CurveComparison] = {**end_points, **(curves or {})}
    beyond = dict(zip(every, holm([each.p_beyond for each in every.values()]), strict=True))
    return Certificate(end_points, beyond, alpha, doubts or {}, curves or {})
