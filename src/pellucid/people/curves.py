r"""Whole curves between conditions: where they differ, and whether they stay together all the way.

Participants' differences of curves over normalised time, :math:`d_i(s)`, give Student's t at every time: SPM{t} of
pairs [1]_. If conditions do not differ, each whole curve is as likely of either sign, so what chance does is counted
over signs of curves: all :math:`2^n` of them, or drawn ones where there are many people. Times stay together, so the
correlation along a curve needs no model.

**Where they differ.** A cluster is a run of times with t beyond the point-wise 5 % of Student's distribution, on one
side; its mass is the sum of t beyond 0. Its p is the share of signs whose largest cluster has at least that mass [2]_.
What a cluster says is that curves differ, thereabouts; its borders are no estimates.

**Whether they stay together.** "Within the margin all along" is claimed if two one-sided tests hold at *every* time: an
intersection-union test again, of level alpha without a correction for how many times there are. "Beyond somewhere" is
claimed by the largest one-sided t beyond a margin, against its largest over signs of curves about their mean. The band
that is drawn holds the whole mean curve with its confidence: the mean and as many standard errors as the largest of
|t| over such signs has in so many of them.

.. [1] T. C. Pataky, "Generalized n-dimensional biomechanical field analysis using statistical parametric mapping", J.
   Biomech. 43, 2010.
.. [2] E. Maris, R. Oostenveld, "Nonparametric statistical testing of EEG- and MEG-data", J. Neurosci. Methods 164,
2007.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from .._errors import PellucidError
from ..numerics.filters import runs
from ..numerics.resampling import linear
from .equivalence import Margin

MAX_EXACT_PARTICIPANTS = 12
"""Up to this many participants the permutation test counts all 2^n combinations of signs."""

SIGN_DRAW_COUNT = 4096
"""Number of sign combinations that are drawn at random for more participants."""

CLUSTER_LEVEL = 0.05
"""Two-sided point-wise level of Student's t: times with a smaller p value belong to a cluster."""


@dataclass(frozen=True)
class Cluster:
    """A run of significant times: first and last index, mass (sum of abs(t)), and the p value of that mass."""

    first: int
    last: int
    mass: float
    p_value: float


@dataclass(frozen=True, eq=False)
class CurveComparison:
    """Comparison of participants' curves in two conditions."""

    mean: np.ndarray  # (m,) mean difference
    t: np.ndarray  # (m,) Student's t
    low: np.ndarray  # (m,) lower end of the confidence band
    high: np.ndarray  # (m,) upper end of the confidence band
    clusters: tuple[Cluster, ...]
    critical: float  # threshold that the largest |t| over time exceeds by chance in 5 % of sign combinations
    margin: Margin | None
    p_within: float  # p value of the claim that the whole curve lies within the margin; NaN without a margin
    p_beyond: float  # p value of the claim that the curve lies beyond the margin somewhere
    alpha: float
    pairs: int

    @property
    def verdict(self) -> str:
        """``"within"``, ``"beyond"`` or ``"undecided"``; ``""`` without a margin."""
        if self.margin is None:
            return ""
        if self.p_within <= self.alpha:
            return "within"
        return "beyond" if self.p_beyond <= self.alpha else "undecided"


def compare_curves(
    differences: np.ndarray, margin: Margin | None = None, *, alpha: float = 0.05
) -> CurveComparison:
    """Compare curves of participants in two conditions.

    Parameters
    ----------
    differences : ndarray, shape (n, m)
        One curve for each participant, the condition less control, at m times.
    margin : Margin, optional
        Margin for the whole mean curve, in the same unit.
    alpha : float
        Probability of a false "within", and of a false "beyond"; the band's confidence level is 1 - 2 alpha.

    Returns
    -------
    CurveComparison

    Raises
    ------
    PellucidError
        If there are fewer than 3 curves, or one holds what is no number.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(4)
    >>> bump = np.exp(-0.5 * ((np.arange(101) - 60.0) / 8.0) ** 2)
    >>> curves = rng.normal(0.0, 0.1, (10, 1)) + rng.normal(1.0, 0.2, (10, 1)) * bump
    >>> found = compare_curves(curves, Margin.either_way(2.0))
    >>> [each.p_value < 0.05 for each in found.clusters], found.verdict
    ([True], 'within')
    """
    d = np.asarray(differences, float)
    if d.ndim != 2 or len(d) < 3 or not np.isfinite(d).all():
        raise PellucidError(f"curves: found differences of shape {d.shape}, expected (n, m) finite numbers, n >= 3")
    n = len(d)
    signs = _sign_flips(n)
    t = _student_t(d)
    drawn = _student_t_by_signs(d, signs)
    point = float(scipy.stats.t.isf(0.5 * CLUSTER_LEVEL, n - 1))
    largest = np.array([max((mass for *_, mass in _find_clusters(row, point)), default=0.0) for row in drawn])
    clusters = tuple(
        Cluster(first, last, mass, float(np.mean(largest >= mass * (1.0 - 1e-12))))
        for first, last, mass in _find_clusters(t, point)
    )
    critical = float(np.quantile(np.abs(drawn).max(axis=1), 1.0 - CLUSTER_LEVEL, method="higher"))
    about = _student_t_by_signs(d - d.mean(axis=0), signs)
    error = np.std(d, axis=0, ddof=1) / np.sqrt(n)
    # n curves scatter less about their own mean than about the true one, so the band is never narrower than Student's.
    reach = max(
        float(np.quantile(np.abs(about).max(axis=1), 1.0 - 2.0 * alpha, method="higher")),
        float(scipy.stats.t.isf(alpha, n - 1)),
    ) * error  # fmt: skip
    within = beyond = float("nan")
    if margin is not None:
        mean = d.mean(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            inner = np.minimum(mean - margin.low, margin.high - mean) / error
            within = float(np.max(np.where(error > 0.0, scipy.stats.t.sf(inner, n - 1), inner <= 0.0)))
            outer = float(np.nanmax(np.maximum(mean - margin.high, margin.low - mean) / error))
        beyond = min(1.0, 2.0 * float(np.mean(about.max(axis=1) >= outer))) if outer > 0.0 else 1.0
        beyond = max(beyond, float(2.0 * scipy.stats.t.sf(outer, n - 1)))
    mean = d.mean(axis=0)
    return CurveComparison(mean, t, mean - reach, mean + reach, clusters, critical, margin, within, beyond, alpha, n)


def _sign_flips(n: int) -> np.ndarray:
    """Return combinations of signs of n curves, (k, n): all of them, or random ones and the observed one."""
    if n <= MAX_EXACT_PARTICIPANTS:
        return 1.0 - 2.0 * ((np.arange(2**n)[:, None] >> np.arange(n)) & 1)
    drawn = np.random.default_rng(0).choice((-1.0, 1.0), (SIGN_DRAW_COUNT, n))
    drawn[0] = 1.0
    return drawn


def _student_t(d: np.ndarray) -> np.ndarray:
    """Return Student's t along time, (m,), of curves (n, m); 0 where all curves are 0."""
    return _student_t_by_signs(d, np.ones((1, len(d))))[0]


def _student_t_by_signs(d: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Return Student's t along time, (k, m), for each row of signs (k, n) of the curves.

    Squares do not depend on signs, so one matrix product with the signs suffices.
    """
    n = len(d)
    mean, square = signs @ d / n, np.mean(d * d, axis=0)
    variance = np.maximum(square - mean**2, 0.0) * n / (n - 1.0)
    return np.divide(mean, np.sqrt(variance / n), out=np.zeros_like(mean), where=variance > 1e-14 * square)


def _find_clusters(t: np.ndarray, point: float) -> list[tuple[int, int, float]]:
    """Return the runs of times with |t| beyond `point`: first index, last index, and the sum of |t|."""
    found = []
    for side in (t, -t):
        if side.max() > point:
            found += [(run.start, run.stop - 1, float(side[run].sum())) for run in runs(side > point)]
    return sorted(found)


def resample_movement(
    time: np.ndarray, samples: np.ndarray, start: float, duration: float, points: int = 101
) -> np.ndarray:
    """Return a signal, (n,) at `time` (n,) [s], resampled at evenly spaced shares of a movement's `duration` [s]."""
    return linear(time, samples, start + duration * np.linspace(0.0, 1.0, points))
