"""Adam with a fixed rate and with one that falls: what it finds, what it leaves, when it converged."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.numerics.searches.adam import adam, linear_decay


def least_squares(matrix, target):
    def cost(x):
        error = matrix @ x - target
        return float(error @ error) / len(error), 2.0 * matrix.T @ error / len(error)

    return cost


@pytest.fixture
def problem(rng):
    matrix = rng.standard_normal((400, 3)) * (1.0, 5.0, 0.3)
    target = matrix @ (0.5, -0.2, 2.0) + 0.1 * rng.standard_normal(400)
    return matrix, target, np.linalg.lstsq(matrix, target, rcond=None)[0]


def test_the_rate_falls_as_equation_1_says():
    rates = linear_decay(0.02, 0.004, 8)
    assert rates[0] == 0.02
    assert rates[4] == pytest.approx(0.012)
    assert np.diff(rates) == pytest.approx(np.full(7, -0.002))


def test_a_falling_rate_ends_at_least_squares_and_a_fixed_one_wanders(problem):
    matrix, target, exact = problem
    falling = adam(least_squares(matrix, target), np.zeros(3), rate=0.05, final_rate=1e-5, iterations=3000)
    assert falling.last == pytest.approx(exact, abs=1e-4)
    assert falling.evaluations == 3001
    assert falling.values.shape == (3001, 3)
    assert falling.costs[-1] == pytest.approx(falling.costs.min(), rel=1e-9)
    assert falling.best == pytest.approx(falling.last, abs=1e-4)

    def one_sample(seed):
        draw = np.random.default_rng(seed)

        def cost(x):
            some = draw.integers(0, len(target), 20)
            return least_squares(matrix[some], target[some])(x)

        return cost

    # With gradients from a few samples at a time, what is left is the rate's.
    fixed = adam(one_sample(1), np.zeros(3), rate=0.05, iterations=3000)
    ended = adam(one_sample(1), np.zeros(3), rate=0.05, final_rate=1e-5, iterations=3000)
    assert np.all(fixed.spread() > 4.0 * ended.spread())


def test_the_first_steps_are_those_of_the_paper_that_made_it(problem):
    matrix, target, _ = problem
    path = adam(least_squares(matrix, target), np.zeros(3), rate=0.01, iterations=2)
    first = least_squares(matrix, target)(path.values[0])[1]
    second = least_squares(matrix, target)(path.values[1])[1]
    assert path.values[1] == pytest.approx(-0.01 * np.sign(first), rel=1e-6)
    mean = (0.9 * 0.1 * first + 0.1 * second) / (1 - 0.9**2)
    square = (0.999 * 0.001 * first**2 + 0.001 * second**2) / (1 - 0.999**2)
    assert path.values[2] - path.values[1] == pytest.approx(-0.01 * mean / np.sqrt(square), rel=1e-6)


def test_a_factor_on_the_cost_changes_nothing(problem):
    matrix, target, _ = problem
    mean = least_squares(matrix, target)

    def total(x):
        value, gradient = mean(x)
        return 1000.0 * value, 1000.0 * gradient

    one = adam(mean, np.zeros(3), rate=0.02, iterations=200)
    other = adam(total, np.zeros(3), rate=0.02, iterations=200)
    assert other.values == pytest.approx(one.values, abs=1e-6)


def test_convergence_is_told_for_each_parameter():
    # A parameter that starts further away, in steps of the same size, arrives later.
    def cost(x):
        error = x - (1.0, 0.1)
        return float(error @ error), 2.0 * error

    path = adam(cost, np.zeros(2), rate=0.01, final_rate=1e-5, iterations=2000)
    far, near = path.converged_at()
    assert near < far < 1000
    assert path.order(("far", "near")) == ("near", "far")
    inside = np.abs(path.values[far:, 0] - 1.0)
    assert inside.max() <= 0.051
    assert abs(path.values[far - 1, 0] - 1.0) > 0.049
    still = adam(cost, np.array([1.0, 0.1]), rate=0.01, iterations=150)
    assert list(still.converged_at()) == [0, 0]


def test_bounds_hold_and_a_cost_that_is_no_number_is_told(problem):
    matrix, target, _ = problem
    path = adam(
        least_squares(matrix, target), np.zeros(3), rate=0.05, final_rate=1e-5, iterations=3000,
        lower=np.full(3, -0.1), upper=np.full(3, 1.0),
    )  # fmt: skip
    assert path.values.min() == -0.1
    assert path.last[1] == -0.1
    with pytest.raises(IdentificationError, match=r"Adam, iteration 0: found the cost nan"):
        adam(lambda x: (float("nan"), x), np.zeros(2), rate=0.1, iterations=3)
    with pytest.raises(IdentificationError, match="expected a first rate above 0"):
        adam(lambda x: (0.0, x), np.zeros(2), rate=0.0, iterations=3)
