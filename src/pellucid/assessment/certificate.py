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
from .equivalence import BEYOND, UNDECIDED, WITHIN, Equivalence, Margin, Method, equivalence

PASS, FAIL, CANNOT_SAY = "transparent", "not transparent", "cannot say"


@dataclass(frozen=True)
class Doubt:
    """What else may have changed an end point, and what it says without that."""

    what: str  # ``"period"``, ``"carry-over"``, ``"learning"`` or ``"left out"``
    p_value: float  # That it is chance
    without: Equivalence
    always: bool = False  # Whether both must say the same even where it is not seen

    def weighs(self, alpha: float) -> bool:
        """Whether it is to be reckoned with: seen beyond chance, at an alpha that is not corrected, or always."""
        return self.always or self.p_value <= alpha


@dataclass(frozen=True)
class Certificate:
    """What end points together say of one condition."""

    end_points: Mapping[str, Equivalence]
    beyond: Mapping[str, float]  # p that each lies beyond its margin, corrected after Holm
    alpha: float
    doubts: Mapping[str, tuple[Doubt, ...]] = field(default_factory=dict)  # By end point
    curves: Mapping[str, CurveComparison] = field(default_factory=dict)  # With margins; as end points are

    @property
    def p_value(self) -> float:
        """That all lie within: the largest of theirs."""
        return max(each.p_within for each in self._all.values())

    @property
    def _all(self) -> dict[str, Equivalence | CurveComparison]:
        return {**self.end_points, **self.curves}

    @property
    def verdict(self) -> str:
        """``"transparent"``, ``"not transparent"`` or ``"cannot say"``."""
        said = [self.said_of(name) for name in self._all]
        if BEYOND in said:
            return FAIL
        return PASS if set(said) == {WITHIN} else CANNOT_SAY

    def tested(self, name: str) -> str:
        """``"within"``, ``"beyond"`` or ``"undecided"`` by one end point's test, beyond after the correction."""
        if self._all[name].p_within <= self.alpha:
            return WITHIN
        return BEYOND if self.beyond[name] <= self.alpha else UNDECIDED

    def contradicted(self, name: str) -> tuple[Doubt, ...]:
        """Doubts that weigh and without which the end point would not say what it says."""
        said = self.tested(name)
        own = self.doubts.get(name, ()) if said != UNDECIDED else ()
        return tuple(doubt for doubt in own if doubt.weighs(self.alpha) and doubt.without.verdict != said)

    def said_of(self, name: str) -> str:
        """What is tested of one end point, and undecided where a doubt contradicts it."""
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
        Chance of a false "transparent".
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
    return joined(made, alpha)


def joined(
    end_points: Mapping[str, Equivalence],
    alpha: float,
    doubts: Mapping[str, tuple[Doubt, ...]] | None = None,
    curves: Mapping[str, CurveComparison] | None = None,
) -> Certificate:
    """End points and curves that are tested already, each at level `alpha`, with what casts doubt on them."""
    every = {**end_points, **(curves or {})}
    beyond = dict(zip(every, holm([each.p_beyond for each in every.values()]), strict=True))
    return Certificate(end_points, beyond, alpha, doubts or {}, curves or {})
