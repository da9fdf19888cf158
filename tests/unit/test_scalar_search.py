"""Search on an interval: it takes the steps of SciPy's bounded search, and survives costs that are not defined."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from pellucid import PellucidError
from pellucid.numerics.searches.scalar_search import minimise_on_interval


def test_it_asks_for_the_same_values_as_scipy():
    rng = np.random.default_rng(1)
    for _ in range(200):
        centre, bend = rng.uniform(-1.0, 1.0), rng.uniform(0.1, 5.0)
        low, high = sorted(rng.uniform(-3.0, 3.0, 2))
        ours, theirs = [], []

        def cost(x, asked, centre=centre, bend=bend):
            asked.append(x)
            return np.cosh(bend * (x - centre)) + 0.1 * np.sin(3.0 * x)

        found = minimise_on_interval(lambda x, asked=ours: cost(x, asked), low, high, tolerance=0.01, evaluations=20)
        best = minimize_scalar(
            lambda x, asked=theirs: cost(x, asked),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 0.01, "maxiter": 20},
        )
        assert ours == pytest.approx(theirs, rel=1e-12)
        assert found == pytest.approx(best.x, rel=1e-12)


def test_it_leaves_values_that_are_not_defined():
    found = minimise_on_interval(lambda x: np.inf if x < 0.3 else (x - 0.5) ** 2, 0.0, 1.0)
    assert found == pytest.approx(0.5, abs=1e-4)


def test_an_interval_of_one_point_is_that_point():
    assert minimise_on_interval(lambda x: x, 2.0, 2.0) == 2.0


@pytest.mark.parametrize("ends", [(1.0, 0.0), (0.0, np.inf), (np.nan, 1.0)])
def test_an_interval_without_ends_in_order_is_refused(ends):
    with pytest.raises(PellucidError, match="expected two finite ends in order"):
        minimise_on_interval(lambda x: x, *ends)
