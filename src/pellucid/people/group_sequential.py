r"""Looking before the end: levels of each look that together spend no more than alpha.

A spending function :math:`\alpha^*(t)` says how much of alpha may be used up when a share t of the participants is
in [1]_; at each look the boundary is where the chance of crossing it now, and none before, is what may newly be spent.
With information that grows in independent steps the statistic after look k is a sum, whose density is carried from
look to look by numerical integration [2]_. The levels serve one-sided tests, each of an equivalence test's two alike.

.. [1] K. K. G. Lan, D. L. DeMets, "Discrete sequential boundaries for clinical trials", Biometrika 70, 1983.
.. [2] P. Armitage, C. K. McPherson, B. C. Rowe, "Repeated significance tests on accumulating data", J. R. Stat. Soc. A
   132, 1969.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

from .._errors import PellucidError

SPENDING_FUNCTIONS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "obrien_fleming": lambda t, alpha: 2.0 * stats.norm.sf(stats.norm.isf(0.5 * alpha) / np.sqrt(t)),
    "pocock": lambda t, alpha: alpha * np.log(1.0 + (np.e - 1.0) * t),
    "linear": lambda t, alpha: alpha * t,
}
"""Spending functions of Lan and DeMets by name: share t of the participants and alpha to the alpha spent so far.

``obrien_fleming`` spends little at first, ``pocock`` about as much at each look, ``linear`` in proportion to t."""

INTEGRATION_NODE_COUNT = 801
"""Number of nodes of the numerical integration over the statistic."""

INTEGRATION_REACH_SD = 8.0
"""The integration over the statistic reaches this many standard deviations to either side."""


@dataclass(frozen=True)
class Looks:
    """One-sided boundaries of a study that is looked at several times."""

    share: tuple[float, ...]  # share of the participants at each look
    boundary: tuple[float, ...]  # boundary of the standardised statistic at each look
    level: tuple[float, ...]  # one-sided level of the test at each look
    spent: tuple[float, ...]  # alpha spent up to and including each look


def looks(share: Sequence[float], alpha: float = 0.05, spending: str = "obrien_fleming") -> Looks:
    """Return the levels of interim looks at given shares of the participants.

    Parameters
    ----------
    share : sequence of float
        Increasing shares of the participants, in (0, 1].
    alpha : float
        One-sided level of the whole study, in (0, 0.5).
    spending : str
        ``"obrien_fleming"``, ``"pocock"`` or ``"linear"``.

    Returns
    -------
    Looks

    Raises
    ------
    PellucidError
        If shares do not rise, or the spending function is none of these.

    Examples
    --------
    >>> [round(z, 2) for z in looks((0.5, 1.0), 0.025).boundary]
    [2.96, 1.97]
    """
    t = np.asarray(share, float)
    if t.ndim != 1 or not len(t) or not (np.diff(t, prepend=0.0) > 0.0).all() or t[-1] > 1.0 + 1e-12:
        raise PellucidError(f"looks: found the shares {list(share)}, expected some that rise, above 0 and up to 1")
    if spending not in SPENDING_FUNCTIONS:
        raise PellucidError(f"looks: found the spending {spending!r}, expected one of {', '.join(SPENDING_FUNCTIONS)}")
    if not 0.0 < alpha < 0.5:
        raise PellucidError(f"looks: found the level {alpha!r}, expected one between 0 and 0.5")
    spent = SPENDING_FUNCTIONS[spending](np.minimum(t, 1.0), alpha)
    boundaries: list[float] = []
    grid = density = None
    for k, new in enumerate(np.diff(spent, prepend=0.0)):
        step = t[k] - (t[k - 1] if k else 0.0)

        def crossing(z: float, now=t[k], step=step, grid=grid, density=density) -> float:
            bound = z * np.sqrt(now)
            if grid is None:
                return float(stats.norm.sf(z))
            return float(np.trapezoid(density * stats.norm.sf((bound - grid) / np.sqrt(step)), grid))

        z = (
            float(optimize.brentq(lambda z, new=new: crossing(z) - new, -INTEGRATION_REACH_SD, INTEGRATION_REACH_SD))
            if new > 1e-14
            else INTEGRATION_REACH_SD
        )
        boundaries.append(z)
        # The study goes on with the density of the sum below the boundary.
        bound = z * np.sqrt(t[k])
        onward = np.linspace(-INTEGRATION_REACH_SD * np.sqrt(t[k]), bound, INTEGRATION_NODE_COUNT)
        if grid is None:
            density = stats.norm.pdf(onward, scale=np.sqrt(step))
        else:
            density = np.trapezoid(density * stats.norm.pdf(onward[:, None] - grid, scale=np.sqrt(step)), grid, axis=1)
        grid = onward
    return Looks(
        tuple(map(float, t)), tuple(boundaries), tuple(float(stats.norm.sf(z)) for z in boundaries),
        tuple(map(float, spent)),
    )  # fmt: skip
