r"""Can n numbers have this mean, minimum, median, maximum, and standard deviation?

The sorted values :math:`x_1 \le \dots \le x_n` with :math:`x_1, x_n`, the middle and the sum known, each to within
rounding, fill a polytope. The sum of squares about the mean is convex on it: it is largest at a corner, and smallest at
one point that a quadratic programme finds.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from pellucid._errors import PellucidError

LARGEST_SAMPLE = 8
"""Values whose corners are listed; there are binomially many."""


def sd_bounds(
    n: int, *, mean: float, low: float, median: float, high: float, half_unit: float = 0.0, ddof: int = 1
) -> tuple[float, float]:
    """The smallest and the largest standard deviation that go with the other statistics."""
    if not 3 <= n <= LARGEST_SAMPLE:
        raise PellucidError(f"standard deviation bounds of {n} values; 3 to {LARGEST_SAMPLE} can be bounded")
    forms, least, most = _polytope(n, (mean, low, median, high), half_unit)
    corners = _corners(forms, least, most)
    if not len(corners):
        raise PellucidError(f"no {n} values have mean {mean}, minimum {low}, median {median} and maximum {high}")

    def squares(x: np.ndarray) -> float:
        return float(np.sum((x - x.mean()) ** 2))

    largest = max(squares(x) for x in corners)
    # In units of the range, so that the programme's tolerance means the same for seconds and for micrometres.
    scale = max(high - low, np.finfo(float).tiny)
    origin = corners.mean(axis=0)
    found = minimize(
        lambda z: squares(origin / scale + z),
        np.zeros(n),
        jac=lambda z: 2.0 * (origin / scale + z - np.mean(origin / scale + z)),
        constraints=LinearConstraint(forms, (least - forms @ origin) / scale, (most - forms @ origin) / scale),
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    return float(np.sqrt(found.fun * scale**2 / (n - ddof))), float(np.sqrt(largest / (n - ddof)))


def _polytope(n: int, statistics: tuple[float, ...], half_unit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows a with lower <= a x <= upper: mean, minimum, median, maximum, then that the values are sorted."""
    mean, low, median, high = (np.zeros(n) for _ in range(4))
    mean[:] = 1.0 / n
    low[0] = high[-1] = 1.0
    median[(n - 1) // 2] += 0.5  # twice the same one where n is odd
    median[n // 2] += 0.5
    steps = np.diff(np.eye(n), axis=0)
    forms = np.vstack([mean, low, median, high, steps])
    known = np.asarray(statistics, float)
    # Sums of decimals miss by a rounding error; a billionth of the largest lets a corner be a corner.
    slack = half_unit + 1e-9 * max(abs(known).max(), 1e-300)
    return (
        forms,
        np.concatenate([known - slack, np.zeros(n - 1)]),
        np.concatenate([known + slack, np.full(n - 1, np.inf)]),
    )


def _corners(forms: np.ndarray, least: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Points of the polytope where as many constraints as there are values hold with equality, shape (m, n)."""
    n = forms.shape[1]
    rows = np.vstack([forms, forms[np.isfinite(most)]])
    ends = np.concatenate([least, most[np.isfinite(most)]])
    chosen = np.array(list(combinations(range(len(rows)), n)))
    systems = rows[chosen]
    regular = np.abs(np.linalg.det(systems)) > 1e-9
    points = np.linalg.solve(systems[regular], ends[chosen[regular]][..., None])[..., 0]
    slack = 1e-9 * max(np.abs(ends).max(), 1e-300)
    values = points @ forms.T
    return points[np.all((values >= least - slack) & (values <= most + slack), axis=1)]
