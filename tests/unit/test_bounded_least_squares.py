"""Least squares within bounds against SciPy's, and what it does at bounds."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from pellucid._errors import IdentificationError
from pellucid.numerics.searches.bounded_least_squares import bounded_least_squares


def rosenbrock(x):
    r = np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
    j = np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])
    return r, j


def equations(x):
    r, j = rosenbrock(x)
    return 0.5 * r @ r, j.T @ r, j.T @ j


@pytest.mark.parametrize("upper", [(2.0, 2.0), (0.5, 2.0), (2.0, 0.2)])
def test_it_ends_where_scipy_ends(upper):
    low, start = np.array([-2.0, -2.0]), np.array([-1.2, 1.0])
    start = np.minimum(start, upper)
    found = bounded_least_squares(equations, start, low, np.array(upper), iterations=300, tolerance=1e-12)
    best = least_squares(
        lambda x: rosenbrock(x)[0], start, lambda x: rosenbrock(x)[1], bounds=(low, upper), ftol=1e-14, xtol=1e-14
    )
    np.testing.assert_allclose(found.x, best.x, atol=1e-5)
    assert np.all(found.x <= upper)
    assert found.converged


def test_a_parameter_with_one_bound_for_both_stays():
    found = bounded_least_squares(equations, np.array([0.3, 1.0]), np.array([0.3, -2.0]), np.array([0.3, 2.0]))
    assert found.x[0] == 0.3
    assert found.x[1] == pytest.approx(0.09, abs=1e-4)


def test_bounds_the_wrong_way_round_are_refused():
    with pytest.raises(IdentificationError, match="expected no lower one above its upper one"):
        bounded_least_squares(equations, np.zeros(2), np.ones(2), np.zeros(2))


def test_a_start_without_a_cost_is_refused():
    with pytest.raises(IdentificationError, match="expected a finite number"):
        bounded_least_squares(lambda x: (np.nan, x, np.eye(2)), np.zeros(2), -np.ones(2), np.ones(2))
