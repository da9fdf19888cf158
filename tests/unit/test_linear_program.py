"""Small linear programs have the solution that SciPy finds."""

import numpy as np
import pytest
from scipy.optimize import linprog

from pellucid.numerics.searches.linear_program import largest_within


def by_scipy(gain, rows, limits, highest):
    return linprog(-gain, A_ub=rows, b_ub=limits, bounds=[(0.0, x) for x in highest], method="highs").x


@pytest.mark.parametrize("seed", range(40))
def test_the_solution_is_scipys(seed):
    rng = np.random.default_rng(seed)
    count, unknowns = int(rng.integers(1, 200)), int(rng.integers(1, 7))
    rows = rng.normal(0.5, 1.0, (count, unknowns)) * 10.0 ** rng.uniform(-3.0, 3.0, unknowns)
    highest = np.where(rng.random(unknowns) < 0.2, 0.0, rng.uniform(0.1, 2.0, unknowns))
    limits = np.abs(rows @ highest) * rng.uniform(0.1, 1.5, count)
    gain = rows.sum(axis=0)
    x, expected = largest_within(gain, rows, limits, highest), by_scipy(gain, rows, limits, highest)
    assert np.all((x >= 0.0) & (x <= highest * (1.0 + 1e-12)))
    assert np.all(rows @ x <= limits + 1e-9 * np.abs(rows).max(axis=1))
    assert gain @ x == pytest.approx(gain @ expected, rel=1e-9, abs=1e-12)


def test_a_limit_of_zero_in_many_rows_ends_the_search():
    rows = np.vstack([np.eye(3), np.ones((50, 3)), [[1.0, -1.0, 0.0]] * 20])
    limits = np.concatenate([np.ones(3), np.zeros(50), np.zeros(20)])
    assert np.all(largest_within(np.array([1.0, 2.0, 3.0]), rows, limits, np.ones(3)) == 0.0)


def test_nothing_is_found_of_no_unknowns():
    assert largest_within(np.zeros(0), np.zeros((4, 0)), np.ones(4), np.zeros(0)).shape == (0,)


def test_rows_that_cannot_bind_do_not_overflow():
    """Rows of zeros with limits above 4 were divided by the smallest number."""
    rows = np.vstack([np.zeros(2), [1e-310, 0.0], [1.0, 1.0]])
    x = largest_within(np.array([1.0, 2.0]), rows, np.array([50.0, 9.0, 1.5]), np.ones(2))
    assert x == pytest.approx([0.5, 1.0])
