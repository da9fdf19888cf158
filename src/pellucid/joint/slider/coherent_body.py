"""Fit one physically consistent body with a carriage: bounded parameters, pseudo-inertia, load-dependent friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..._errors import IdentificationError
from ..._processes import with_one_blas_thread
from ...models.slider_joint import SliderJointModel
from ...numerics.regression import (
    Stack,
    make_parameters,
    nearest_feasible,
    regression_rows,
    snap_to_bounds,
    solve,
    stack,
)
from ...numerics.uncertainty import sandwich_covariance
from ..fit.discrepancy import collect_states, estimate_discrepancy
from .slider_motion import SliderMotion
from .three_steps import SliderEstimate, require_both_directions, require_places

FIRST_LOAD_COEFFICIENT = 0.05
"""First value of the load-friction coefficients in the search."""

MAX_RELINEARISATIONS = 12
"""Largest number of relinearisations under the consistency conditions."""


@with_one_blas_thread
def fit_coherent(
    model: SliderJointModel,
    motions: Sequence[SliderMotion],
    *,
    rail: tuple[float, float],
    mass: float | None = None,
    start: np.ndarray | None = None,
) -> SliderEstimate:
    """Fit a `model` to `motions` by bounded least squares.

    If no body could have the estimated inertia and gravity, the nearest consistent parameters are taken: for a carriage
    on a `rail` [m] and a mass of at most `mass` [kg]. `start`, shape (p,), is the first value of a nonlinear family.
    """

    require_both_directions(motions)
    require_places(motions)
    if start is None:
        start = np.array(
            [FIRST_LOAD_COEFFICIENT if n.startswith("load") else 0.1 if n == "inertia" else 0.0 for n in model.names]
        )
    data = stack(motions)
    found = solve(model, data, start=start)
    values, held, notes = found.values, found.at_bound, []
    if np.min(model.gaps(values, rail, mass)) < 0.0:
        values = _nearest_possible_body(model, values, data, rail, mass)
        notes.append("inertia and gravity are held where a body of these masses can have them")
    w, residual = found.jacobian, found.residual
    if notes or held.any():  # the values are not those of the search's last step
        w, effort = regression_rows(model, values, data)
        residual = data.target - effort
    if notes:
        held = snap_to_bounds(values, *model.bounds(), w, residual)[1]
    statistical = sandwich_covariance(w, residual, data.lengths)
    slowest = min(float(np.abs(m.velocity[m.scored]).min(initial=np.inf)) for m in data.motions)

    def load(motion: SliderMotion, position: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        slider = np.asarray(motion.slider)
        return model.inertia(values, slider) * acceleration + model.gravity(values, slider, position)

    states = collect_states(data, True, load, slowest)
    lacking = estimate_discrepancy(model.names, values, w, residual, states, statistical)
    covariance = statistical + lacking.covariance
    units = [model.unit(n) for n in model.names]
    parameters = make_parameters(
        model.names, units, values, covariance, held, statistical=statistical, causes=lacking.causes
    )
    notes += [
        f"{n} is held at its physical bound, {v:.3g}" for n, v, h in zip(model.names, values, held, strict=True) if h
    ]
    return SliderEstimate(
        method=model.family,
        model=model,
        values=values,
        parameters=tuple(replace(p, carried=lacking.carried.get(p.name)) for p in parameters),
        covariance=covariance,
        samples=len(residual),
        residual_sd=float(np.std(residual)),
        notes=tuple(notes),
        statistical=statistical,
    )


def _nearest_possible_body(
    model: SliderJointModel,
    values: np.ndarray,
    data: Stack[SliderMotion],
    rail: tuple[float, float],
    mass: float | None,
) -> np.ndarray:
    """Return the nearest consistent parameters, in the metric of the residuals."""

    lower, upper = model.bounds()
    best = None
    for _ in range(1 if model.linear else MAX_RELINEARISATIONS):
        w, effort = regression_rows(model, values, data)
        inside = _consistent_start(model, np.clip(values, lower, upper), rail, mass)
        unit = model.inertia(inside, np.array(rail)).max()
        found, said = nearest_feasible(
            w,
            data.target - effort,
            values,
            (lower, upper),
            partial(_scaled_room, model, rail, mass, unit),
            inside,
        )
        if np.min(model.gaps(found, rail, mass)) < -1e-6:
            raise IdentificationError(f"no possible body found near these recordings: {said}")
        if best is None:
            best, least = found, _misfit(model, found, data)
        else:
            step, misfit = 1.0, _misfit(model, found, data)
            while misfit > least and step > 1e-3:  # consistent bodies form a convex set, so shorter steps stay in it
                step *= 0.5
                misfit = _misfit(model, best + step * (found - best), data)
            if misfit >= least:
                break
            best, least = best + step * (found - best), misfit
        values = best
    return values


def _scaled_room(
    model: SliderJointModel, rail: tuple[float, float], mass: float | None, unit: float, values: np.ndarray
) -> np.ndarray:
    """Return the conditions of consistency, divided by the inertia `unit`, (k,)."""
    return model.room(values, rail, mass) / unit


def _misfit(model: SliderJointModel, values: np.ndarray, data: Stack[SliderMotion]) -> float:
    effort = data.reduced([model.effort(values, m) for m in data.motions])
    return float(np.sum((data.target - effort) ** 2))


def _consistent_start(
    model: SliderJointModel, values: np.ndarray, rail: tuple[float, float], mass: float | None
) -> np.ndarray:
    """Return a consistent starting point: the values with more inertia and at least some mass of the carriage."""
    values = values.copy()
    if "carriage_mass" in model.names:
        at = model.names.index("carriage_mass")
        values[at] = max(values[at], 0.05)
    at = model.names.index("inertia")
    values[at] = max(values[at], 1e-4)
    while np.min(model.gaps(values, rail, mass)) < 0.0 and values[at] < 1e6:
        values[at] *= 1.5
    return values
