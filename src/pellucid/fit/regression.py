r"""Bounded least squares on filtered data: one procedure for every body whose effort the core can compute.

.. math::
   F\,\tau = F\,\tau_{model}(q, \dot q, \ddot q; \beta) + \rho, \qquad W = F\,\partial\tau_{model}/\partial\beta

with F the same zero-phase filter and decimation on both sides. The regressor is the exact Jacobian of the core's
inverse dynamics, so that what is linear in its parameters (one Gauss-Newton step is then ordinary least squares,
IDIM-LS [1]_) and what is not take the same way.

.. [1] M. Gautier, "Dynamic identification of robots with power model", Proc. IEEE ICRA, 1997.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .._errors import IdentificationError
from .parameter import Parameter

LONG = 50_000
"""Samples of a motion from which on a model's own way to its rows is taken, if it has one; linear ones always."""


class FittedMotion(Protocol):
    """A motion that may enter a regression: `effort`, (n,), beside the states that a model reads, and `rows`."""

    effort: np.ndarray

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """The samples, (n,) or (n, k), that a regression uses: trimmed, thinned, without those at rest."""


class ForceModel(Protocol):
    """What a regression needs to know of a body: names and bounds of its free parameters, and its effort."""

    names: tuple[str, ...]
    label: str
    linear: bool

    def unit(self, name: str) -> str:
        """SI unit of a parameter, as plain text."""

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Physical lower and upper bounds, each (p,), SI."""

    def effort(self, values: np.ndarray, motion: FittedMotion) -> np.ndarray:
        """Effort, (n,), along a motion, filtered as the measured effort was."""

    def jacobian(self, values: np.ndarray, motion: FittedMotion) -> tuple[np.ndarray, np.ndarray]:
        """The same, and its derivative by the parameters, (n, p)."""


@dataclass(frozen=True)
class Stack:
    """Several motions and their measured efforts, (m_i,), reduced to the rows that are fitted."""

    motions: tuple[FittedMotion, ...]
    targets: tuple[np.ndarray, ...]

    @property
    def target(self) -> np.ndarray:
        """All targets, shape (m,), in the effort's unit."""
        return np.concatenate(self.targets)

    @property
    def lengths(self) -> list[int]:
        """Rows of each motion."""
        return [len(t) for t in self.targets]

    def reduced(self, signals: Sequence[np.ndarray]) -> np.ndarray:
        """Rows of one signal (n_i,) or (n_i, k) per motion, stacked."""
        return np.concatenate([m.rows(x) for m, x in zip(self.motions, signals, strict=True)])


def stack(motions: Sequence[FittedMotion]) -> Stack:
    """Reduce the effort of every motion."""
    if not motions:
        raise IdentificationError('no recording is marked use = "fit"; at least one must be')
    targets = tuple(m.rows(m.effort) for m in motions)
    if not any(len(t) for t in targets):
        top = max(float(np.abs(m.velocity).max()) for m in motions)
        raise IdentificationError(
            f"no sample is left to fit: none is faster than the dead band, and the fastest moves at {top:.3g}; "
            "lower the dead band or record a faster motion"
        )
    return Stack(tuple(motions), targets)


def linearised(
    model: ForceModel, values: np.ndarray, motions: Sequence[FittedMotion]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Efforts, (n_i,), and regressors, (n_i, p), of each motion at `values`, (p,), filtered as the measured effort."""
    pairs = [model.jacobian(values, m) for m in motions]
    return [effort for effort, _ in pairs], [jacobian for _, jacobian in pairs]


def predicted(model: ForceModel, values: np.ndarray, motions: Sequence[FittedMotion]) -> list[np.ndarray]:
    """The model's effort for each motion, (n_i,), at full rate, filtered as the measured effort was."""
    return [model.effort(values, m) for m in motions]


def rows_of(model: ForceModel, values: np.ndarray, data: Stack) -> tuple[np.ndarray, np.ndarray]:
    """Regressor (m, p) and modelled effort (m,) at `values`, (p,)."""
    # One motion after another: of hours, a regressor before it is thinned would take all memory.
    made = [_rows(model, values, m) for m in data.motions]
    return np.concatenate([rows for _, rows in made]), np.concatenate([effort for effort, _ in made])


def effort_rows(model: ForceModel, values: np.ndarray, motion: FittedMotion) -> np.ndarray:
    """Modelled effort, (m,), of one motion at `values`, (p,)."""
    return _rows(model, values, motion)[0] if _sooner(model, motion) else motion.rows(model.effort(values, motion))


def _sooner(model: ForceModel, motion: FittedMotion) -> bool:
    return hasattr(model, "rows") and (model.linear or len(motion.effort) > LONG)


def _rows(model: ForceModel, values: np.ndarray, motion: FittedMotion) -> tuple[np.ndarray, np.ndarray]:
    if _sooner(model, motion):
        return model.rows(values, motion)
    rows = motion.rows(np.column_stack(model.jacobian(values, motion)))
    return rows[:, 0], rows[:, 1:]


@dataclass(frozen=True)
class Solution:
    """Where a solver ended.

    `values` (p,), `jacobian` (m, p) and `residual` (m,) at the solution; `weights` (m,) multiplied residuals;
    `at_bound` (p,) marks active bounds.
    """

    values: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray
    weights: np.ndarray
    at_bound: np.ndarray
    iterations: int
    converged: bool


def solve(
    model: ForceModel,
    data: Stack,
    *,
    weights: np.ndarray | None = None,
    bounds: tuple[np.ndarray, np.ndarray] | None = None,
    start: np.ndarray | None = None,
    after: Solution | None = None,
) -> Solution:
    """Minimise the weighted sum of squared effort residuals within the model's bounds. `weights` (m,); `bounds`
    (p,); `start` (p,)."""
    w = np.ones(len(data.target)) if weights is None else np.asarray(weights, float)
    lower, upper = model.bounds() if bounds is None else bounds
    if model.linear:
        if after is None:
            jacobian, effort = rows_of(model, np.zeros(len(model.names)), data)
            target = data.target - effort
        else:
            jacobian, target = after.jacobian, after.residual + after.jacobian @ after.values
        weighted = jacobian * w[:, None]
        require_full_rank(model.names, weighted, model.label)
        values = least_squares_within(weighted, target * w, lower, upper)
        residual, iterations, converged = target - jacobian @ values, 1, True
    else:
        first = after.values if after is not None else start
        # Reweighting moves the minimum a little each time: a few steps follow it.
        values, iterations, converged = _gauss_newton(model, data, w, lower, upper, first, 60 if after is None else 8)
        jacobian, effort = rows_of(model, values, data)
        residual = data.target - effort
    snapped, held = at_bounds(values, lower, upper, jacobian, residual)
    return Solution(snapped, jacobian, residual - jacobian @ (snapped - values), w, held, iterations, converged)


def least_squares_within(
    w: np.ndarray, y: np.ndarray, lower: np.ndarray, upper: np.ndarray, *, method: str = "trf"
) -> np.ndarray:
    """The x, (p,), that minimises ||W x - y|| with `w`, (m, p), and `y`, (m,), within bounds `lower` and `upper`,
    (p,). By trust regions values end close to a bound, by an active set ("bvls") on it: a Stribeck profile over
    velocities that fit alike chooses by what the former leaves."""
    scale = np.linalg.norm(w, axis=0)
    values = np.linalg.lstsq(w, y, rcond=None)[0]
    if np.all(values >= lower) and np.all(values <= upper):
        return values
    from scipy.optimize import lsq_linear  # only where a bound is crossed: a study is checked without

    tolerance = {"trf": 1e-12, "bvls": 1e-14}[method]
    found = lsq_linear(w / scale, y, bounds=(lower * scale, upper * scale), method=method, tol=tolerance)
    return np.clip(found.x / scale, lower, upper)


def _gauss_newton(
    model: ForceModel, data: Stack, w: np.ndarray, lower: np.ndarray, upper: np.ndarray, start: np.ndarray, most: int
) -> tuple[np.ndarray, int, bool]:
    """Bounded least squares over a model that is not linear: values, evaluations of at `most` so many, and whether it
    converged."""
    from scipy.optimize import least_squares

    # Parameters in units of the effort they make: tolerances then mean the same in newtons, volts and amperes.
    size = float(np.linalg.norm(data.target * w))
    first = rows_of(model, start, data)[0] * w[:, None]
    require_full_rank(model.names, first, model.label)
    scale = size / np.linalg.norm(first, axis=0)

    @last_call
    def both(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        jacobian, effort = rows_of(model, x * scale, data)
        return (effort - data.target) * w / size, jacobian * scale * w[:, None] / size

    low, high = lower / scale, upper / scale
    inside = np.clip(start / scale, low + 1e-6, np.where(np.isfinite(high), high - 1e-6, high))
    found = least_squares(
        lambda x: both(x)[0],
        inside,
        jac=lambda x: both(x)[1],
        bounds=(low, high),
        xtol=1e-8,
        ftol=1e-12,
        gtol=1e-12,
        max_nfev=most,
    )
    return found.x * scale, int(found.nfev), bool(found.success)


def nearest(
    jacobian: np.ndarray,
    residual: np.ndarray,
    values: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    room: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
) -> tuple[np.ndarray, str]:
    """The values, (p,), nearest to `values`, with `jacobian`, (m, p), and `residual`, (m,), there, in the metric of
    their residuals, within `bounds` and where `room` >= 0, searched from `start`; and what the search said."""
    from scipy.optimize import minimize

    size = float(np.linalg.norm(residual + jacobian @ values))
    scale = size / np.linalg.norm(jacobian, axis=0)
    scaled = jacobian * (scale / size)
    gram, moment, origin = scaled.T @ scaled, scaled.T @ (residual / size), values / scale

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        d = x - origin
        return float(0.5 * d @ gram @ d - moment @ d), gram @ d - moment

    found = minimize(
        cost,
        start / scale,
        jac=True,
        method="SLSQP",
        bounds=list(zip(bounds[0] / scale, bounds[1] / scale, strict=True)),
        constraints={"type": "ineq", "fun": lambda x: room(x * scale)},
        options={"maxiter": 500, "ftol": 1e-15},
    )
    return found.x * scale, str(found.message)


def at_bounds(
    values: np.ndarray, lower: np.ndarray, upper: np.ndarray, jacobian: np.ndarray, residual: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`values`, (p,), with those closer to a bound, `lower` or `upper`, than a thousandth of their noise on it, and
    which those are, (p,); `jacobian`, (m, p), and `residual`, (m,), there."""
    power = np.sum(jacobian**2, axis=0)
    noise = np.sqrt(np.mean(residual**2) / np.where(power > 0.0, power, np.inf))
    near = 1e-3 * noise + 1e-9 * np.abs(values)
    low, high = values - lower <= near, upper - values <= near
    return np.where(low, lower, np.where(high, upper, values)), low | high


def require_full_rank(names: Sequence[str], jacobian: np.ndarray, where: str) -> None:
    """Refuse a regressor, `jacobian`, (m, p), of parameters `names`, that is singular to working precision; `where`
    stands in messages."""
    if len(jacobian) <= jacobian.shape[1]:
        raise IdentificationError(
            f"{where}: {len(jacobian)} usable samples for {jacobian.shape[1]} parameters; expected many more: lengthen "
            "the recording, or lower decimate and dead_band"
        )
    norms = np.linalg.norm(jacobian, axis=0)
    absent = [n for n, c in zip(names, norms, strict=True) if not c > 1e-12 * norms.max()]
    if absent:
        raise IdentificationError(
            f"{where}: {' and '.join(absent)} cannot be identified: nothing in the recordings excites "
            f"{'it' if len(absent) == 1 else 'them'}"
        )
    _, singular, rows = np.linalg.svd(np.linalg.qr(jacobian / norms, mode="r"))
    if singular[-1] < 1e-7 * singular[0]:
        tied = [n for n, c in zip(names, rows[-1], strict=True) if abs(c) > 0.2]
        raise IdentificationError(
            f"{where}: {' and '.join(tied)} cannot be told apart in these recordings: their effects are proportional"
        )


def parameters_of(
    names: Sequence[str],
    units: Sequence[str],
    values: np.ndarray,
    covariance: np.ndarray,
    held: np.ndarray | None = None,
    idle: np.ndarray | None = None,
    statistical: np.ndarray | None = None,
    causes: Sequence[str] = (),
) -> tuple[Parameter, ...]:
    """Parameters `names` in `units` with `values`, (p,), and `covariance`, (p, p), those at their bound marked in
    `held`, (p,); identifiable where the 95 % interval leaves out 0, but for those `idle`, (p,).

    Where coloured residuals alone, `statistical` (p, p), would leave 0 out and what the model lacks does not, there is
    no telling what is whose: the interval is refused, and the `causes`, (p,), say what may stand behind the value.
    """
    made = []
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        value, error = float(values[i]), float(np.sqrt(max(covariance[i, i], 0.0)))
        bound = held is not None and bool(held[i])
        shown = not bound and abs(value) > 1.959964 * error and not (idle is not None and idle[i])
        coloured = error if statistical is None else float(np.sqrt(max(statistical[i, i], 0.0)))
        hidden = not bound and 1.959964 * coloured < abs(value) <= 1.959964 * error
        refused = f"what the model leaves out may be all of it, {causes[i]} first" if hidden and causes else ""
        made.append(
            Parameter(
                name,
                unit,
                value,
                error,
                at_bound=bound,
                identifiable=shown,
                statistical_error=coloured,
                refused=refused,
            )
        )
    return tuple(made)


def last_call(function: Callable[[np.ndarray], tuple]) -> Callable[[np.ndarray], tuple]:
    """Remember the last point of a `function` of one array: SciPy asks for residual and Jacobian in two calls."""
    memory: dict[bytes, tuple] = {}

    def remembered(values: np.ndarray) -> tuple:
        key = values.tobytes()
        if key not in memory:
            memory.clear()
            memory[key] = function(values)
        return memory[key]

    return remembered
