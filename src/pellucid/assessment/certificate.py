r"""May a robot be called transparent? All end points together, each within its margin.

"Transparent" is claimed only if every end point lies within its margin: an intersection-union test, whose level is
that of each [1]_, so that nothing is divided by the number of end points; power is what many of them cost. "Not
transparent" is claimed if one end point lies beyond its margin; of several tries one may succeed by chance, so their p
are corrected after Holm. Between both the study cannot say, and is told how many participants would.

.. [1] R. L. Berger, J. C. Hsu, "Bioequivalence trials, intersection-union tests and equivalence confidence sets", Stat.
   Sci. 11, 1996.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .._errors import PellucidError
from .comparison import holm
from .equivalence import BEYOND, WITHIN, Equivalence, Margin, Method, equivalence

PASS, FAIL, CANNOT_SAY = "transparent", "not transparent", "cannot say"


@dataclass(frozen=True)
class Certificate:
    """What end points together say of one condition."""

    end_points: Mapping[str, Equivalence]
    beyond: Mapping[str, float]  # p that each lies beyond its margin, corrected after Holm
    alpha: float

    @property
    def p_value(self) -> float:
        """That all lie within: the largest of theirs."""
        return max(each.p_within for each in self.end_points.values())

    @property
    def verdict(self) -> str:
        """``"transparent"``, ``"not transparent"`` or ``"cannot say"``."""
        if self.p_value <= self.alpha:
            return PASS
        return FAIL if min(self.beyond.values()) <= self.alpha else CANNOT_SAY

    def said_of(self, name: str) -> str:
        """``"within"``, ``"beyond"`` or ``"undecided"`` of one end point, beyond after the correction."""
        own = self.end_points[name].verdict
        if own == WITHIN:
            return own
        return BEYOND if self.beyond[name] <= self.alpha else "undecided"


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
    beyond = dict(zip(made, holm([each.p_beyond for each in made.values()]), strict=True))
    return Certificate(made, beyond, alpha)
