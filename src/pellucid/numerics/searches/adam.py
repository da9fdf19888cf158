r"""Adam [1]_ with a fixed or a linearly decaying learning rate, for any cost with a gradient.

.. math::
    m_t &= \beta_1 m_{t-1} + (1-\beta_1) g_t, \qquad v_t = \beta_2 v_{t-1} + (1-\beta_2) g_t^2 \\
    x_{t+1} &= x_t - \eta_t \frac{m_t / (1-\beta_1^t)}{\sqrt{v_t / (1-\beta_2^t)} + \epsilon}, \qquad
    \eta_t = \eta_0 - (\eta_0 - \eta_{end}) \, t / T

A step does not shrink with the gradient, because it is divided by the gradient's recent size. With a fixed rate the
parameters therefore keep moving near the minimum, always if the gradient is noisy and intermittently if it is not. A
decaying rate ends this.

A factor on the cost cancels except for epsilon, so summed and averaged errors give the same steps. Costs are means
here, so that recordings of different length can be compared.

.. [1] D. P. Kingma, J. L. Ba, "Adam: a method for stochastic optimization", ICLR, 2015.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError

CostAndGradient = Callable[[np.ndarray], tuple[float, np.ndarray]]
"""A function from parameters of shape (p,) to a cost and its gradient of shape (p,)."""

FINAL_ITERATIONS = 100
"""Number of final iterations on which convergence is tested."""

CONVERGED_SHARE = 0.05
"""A parameter has converged once it stays within this share of its total change from its final value."""


@dataclass(frozen=True, eq=False)
class AdamPath:
    """Parameters and costs of all iterations of Adam."""

    values: np.ndarray = field(repr=False)  # (iterations + 1, p) parameters at each iteration, the start first
    costs: np.ndarray = field(repr=False)  # (iterations + 1,) cost at each iteration
    rates: np.ndarray = field(repr=False)  # (iterations,) learning rate of each iteration
    evaluations: int  # number of evaluations of the cost with its gradient

    @property
    def last(self) -> np.ndarray:
        """Parameters after the last iteration, shape (p,)."""
        return self.values[-1]

    @property
    def best(self) -> np.ndarray:
        """Parameters of the lowest cost, shape (p,)."""
        return self.values[int(np.argmin(self.costs))]

    def spread(self, last: int = FINAL_ITERATIONS) -> np.ndarray:
        """Return the standard deviation of each parameter over the `last` iterations, shape (p,)."""
        return np.std(self.values[-last:], axis=0)

    def converged_at(self, share: float = CONVERGED_SHARE) -> np.ndarray:
        """Return the iteration after which each parameter stays close to its final value, shape (p,).

        The final value is the median over the last `FINAL_ITERATIONS` iterations. Close means within `share` of the
        distance between start and final value. A parameter that leaves this band in the last iterations has not
        converged.
        """
        end = np.median(self.values[-FINAL_ITERATIONS:], axis=0)
        outside = np.abs(self.values - end) > share * np.abs(end - self.values[0])
        count = len(self.values)
        return np.where(outside.any(axis=0), count - np.argmax(outside[::-1], axis=0), 0)

    def order(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the parameters' names in the order in which they converged."""
        return tuple(names[i] for i in np.argsort(self.converged_at(), kind="stable"))


def linear_decay(first: float, last: float, iterations: int) -> np.ndarray:
    """Return linearly decaying learning rates (eq. 1 of the paper `hill`), shape (iterations,)."""
    return first - (first - last) * np.arange(iterations) / iterations


def adam(
    cost: CostAndGradient,
    start: np.ndarray,
    *,
    rate: float,
    final_rate: float | None = None,
    iterations: int,
    beta: tuple[float, float] = (0.9, 0.999),
    epsilon: float = 1e-8,
    scale: np.ndarray | None = None,
    lower: np.ndarray | None = None,
    upper: np.ndarray | None = None,
) -> AdamPath:
    """Minimise a cost by Adam.

    `start`, `scale`, `lower` and `upper` have shape (p,). The rate decays linearly if `final_rate` is given.
    """
    if not rate > 0.0 or (final_rate is not None and final_rate < 0.0) or iterations < 1:
        raise IdentificationError(
            f"found the rates {rate} and {final_rate} and {iterations} iterations, expected a first rate above 0, a "
            "last one of at least 0, and at least one iteration"
        )
    x = np.array(start, dtype=float)
    unit = np.ones_like(x) if scale is None else np.asarray(scale, dtype=float)
    low = np.full_like(x, -np.inf) if lower is None else np.asarray(lower, dtype=float)
    high = np.full_like(x, np.inf) if upper is None else np.asarray(upper, dtype=float)
    rates = np.full(iterations, float(rate)) if final_rate is None else linear_decay(rate, final_rate, iterations)
    values, costs = np.empty((iterations + 1, len(x))), np.empty(iterations + 1)
    mean, square = np.zeros_like(x), np.zeros_like(x)
    keep_mean, keep_square = beta
    left_mean, left_square = 1.0, 1.0
    for t in range(iterations):
        values[t] = x
        costs[t], gradient = cost(x)
        gradient = unit * gradient
        if not (np.isfinite(costs[t]) and np.isfinite(gradient).all()):
            raise IdentificationError(
                f"Adam, iteration {t}: found the cost {costs[t]} and the gradient {gradient} at {x}, expected finite "
                "numbers; lower the rate or bound the parameters"
            )
        left_mean, left_square = left_mean * keep_mean, left_square * keep_square
        mean = keep_mean * mean + (1.0 - keep_mean) * gradient
        square = keep_square * square + (1.0 - keep_square) * gradient * gradient
        step = mean / (1.0 - left_mean) / (np.sqrt(square / (1.0 - left_square)) + epsilon)
        x = np.minimum(np.maximum(x - rates[t] * unit * step, low), high)
    values[-1] = x
    costs[-1] = cost(x)[0]
    return AdamPath(values, costs, rates, iterations + 1)
