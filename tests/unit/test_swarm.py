"""Swarm and conjugate gradients on functions whose minimum is known."""

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.numerics.searches.swarm import conjugate_gradient, swarm_with_gradients


def sphere(x):
    return float(np.sum((x - 0.3) ** 2)), 2.0 * (x - 0.3)


def rosenbrock(x):
    a, b = x[1:] - x[:-1] ** 2, 1.0 - x[:-1]
    gradient = np.zeros_like(x)
    gradient[:-1] = -400.0 * a * x[:-1] - 2.0 * b
    gradient[1:] += 200.0 * a
    return float(np.sum(100.0 * a**2 + b**2)), gradient


def rastrigin(x):
    return (
        float(np.sum(x**2 - 10.0 * np.cos(2.0 * np.pi * x) + 10.0)),
        2.0 * x + 20.0 * np.pi * np.sin(2.0 * np.pi * x),
    )


def test_conjugate_gradients_need_few_steps_where_the_cost_is_quadratic():
    matrix = np.diag([1.0, 10.0, 100.0, 1000.0])
    target = np.array([1.0, -2.0, 3.0, 0.5])

    def cost(x):
        return float(0.5 * (x - target) @ matrix @ (x - target)), matrix @ (x - target)

    found = conjugate_gradient(cost, np.zeros(4), tolerance=1e-14)
    assert found.best == pytest.approx(target, abs=1e-5)
    # Steepest descent with exact line searches needs several thousand at this condition.
    assert found.gradients < 60

    def in_another_order(x):
        away = (x - target)[::-1]
        return float(0.5 * np.sum(matrix.diagonal()[::-1] * away**2)), matrix.diagonal() * (x - target)

    # What the processor's kernels round otherwise must not say how many there are.
    other = conjugate_gradient(in_another_order, np.zeros(4), tolerance=1e-14)
    assert abs(other.gradients - found.gradients) <= 2


def test_conjugate_gradients_follow_a_bent_valley():
    found = conjugate_gradient(rosenbrock, np.array([-1.2, 1.0]), iterations=2000, tolerance=1e-14)
    assert found.best == pytest.approx((1.0, 1.0), abs=1e-3)
    assert found.evaluations >= found.gradients


def test_line_searches_ask_for_the_cost_alone_where_they_may():
    start, options = np.array([-1.2, 1.0]), {"iterations": 2000, "tolerance": 1e-14}
    both = conjugate_gradient(rosenbrock, start, **options)
    alone = conjugate_gradient(rosenbrock, start, value=lambda x: rosenbrock(x)[0], **options)
    np.testing.assert_array_equal(alone.best, both.best)
    assert (alone.evaluations, alone.gradients) == (both.evaluations, both.gradients)
    asked = []
    conjugate_gradient(
        lambda x: (asked.append(1), rosenbrock(x))[1], start, value=lambda x: rosenbrock(x)[0], **options
    )
    assert len(asked) == alone.gradients < alone.evaluations / 2


def test_conjugate_gradients_stop_at_bounds():
    found = conjugate_gradient(
        sphere, np.array([0.9, -0.5, 2.0]), lower=np.array([0.5, -1.0, -1.0]), upper=np.array([1.0, 0.1, 1.0])
    )
    assert found.best == pytest.approx((0.5, 0.1, 0.3), abs=1e-6)


def test_the_swarm_finds_the_lowest_of_many_minima(rng):
    low, high = np.full(2, -5.12), np.full(2, 5.12)
    both = swarm_with_gradients(lambda x: rastrigin(x)[0], rastrigin, low, high, rng=rng, particles=30)
    assert both.best == pytest.approx((0.0, 0.0), abs=1e-5)
    # Gradients alone end in the minimum next to where they began.
    assert conjugate_gradient(rastrigin, np.array([3.2, -2.2]), lower=low, upper=high).cost > 1.0


def test_what_a_search_took_is_told(rng):
    counts = [0, 0]

    def cost(x):
        counts[0] += 1
        return sphere(x)[0]

    def with_gradient(x):
        counts[1] += 1
        return sphere(x)

    found = swarm_with_gradients(cost, with_gradient, np.zeros(3), np.ones(3), rng=rng, particles=5, iterations=4)
    assert found.evaluations == sum(counts)
    assert found.gradients == counts[1]
    assert np.all(np.diff(found.trail[:, 1]) < 0.0)
    assert found.trail[-1, 1] == found.cost
    assert found.evaluations_until(found.cost) <= found.evaluations
    assert found.evaluations_until(-1.0) is None


def test_equal_seeds_search_alike_and_bounds_hold():
    seen = []

    def cost(x):
        seen.append(x)
        return rastrigin(x)[0]

    low, high = np.array([-1.0, 2.0]), np.array([0.5, 3.0])
    found = [
        swarm_with_gradients(cost, rastrigin, low, high, rng=np.random.default_rng(5), particles=6) for _ in range(2)
    ]
    assert np.array_equal(found[0].trail, found[1].trail)
    assert np.all(np.array(seen) >= low)
    assert np.all(np.array(seen) <= high)


def test_what_cannot_be_searched_is_told(rng):
    with pytest.raises(IdentificationError, match="expected each lower one below its upper one"):
        swarm_with_gradients(lambda x: 0.0, sphere, np.zeros(2), np.zeros(2), rng=rng)
    with pytest.raises(IdentificationError, match="found no place with a finite cost"):
        swarm_with_gradients(lambda x: float("nan"), sphere, np.zeros(2), np.ones(2), rng=rng, particles=3)
    with pytest.raises(IdentificationError, match="at the start"):
        conjugate_gradient(lambda x: (float("nan"), x), np.zeros(2))
