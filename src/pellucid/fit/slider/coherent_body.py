r"""One coherent body with a carriage, fitted in one regression: physical bounds, pseudo-inertia, friction by load.

The regressor is the core's exact Jacobian. Terms smooth in the filtered states are filtered already; friction passes
the same zero-phase filter as the effort did.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ... import _core
from ..._errors import IdentificationError
from ...models.directional_slider import VELOCITY_WIDTH
from ...models.joint import INDEX
from ...models.slider_joint import SliderJointModel
from ...signals.slider_motion import SliderMotion
from ..joint.regression import last_call
from ..parameter import Parameter
from ..uncertainty import sandwich
from .slider_fit import SliderEstimate
from .three_steps import STRIDE, bounded_least_squares, require_both_directions, require_places

BODY_TERMS = np.array([INDEX[n] for n in ("inertia", "gravity_sine", "gravity_cosine")])
ACTIVE = np.array([i for name, i in INDEX.items() if name not in ("velocity_width", "stribeck", "stribeck_velocity")])
LOAD_START = 0.05
ROUNDS = 12  # relinearisations under the consistency conditions


def torque(model: SliderJointModel, values: np.ndarray, motion: SliderMotion) -> np.ndarray:
    """The model's torque for a motion, friction filtered as the effort was, shape (n,) [N*m].

    Parameters
    ----------
    model : SliderJointModel
    values : ndarray, shape (p,)
    motion : SliderMotion

    Returns
    -------
    ndarray, shape (n,)
    """
    vector = model.vector(values, motion.slider, VELOCITY_WIDTH)
    body = _core.load(vector, motion.position, motion.acceleration)
    whole = _core.inverse_dynamics(vector, motion.position, motion.velocity, motion.acceleration)
    return body + motion.smooth(whole - body)


def linearised(
    model: SliderJointModel, values: np.ndarray, motions: Sequence[SliderMotion]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]:
    """Regressor (m, p), modelled torque (m,), measured torque (m,) [N*m] of the scored samples, and samples by motion.

    Parameters
    ----------
    model : SliderJointModel
    values : ndarray, shape (p,)
    motions : sequence of SliderMotion

    Returns
    -------
    jacobian, effort, target, lengths
    """
    parts = []
    for m in motions:
        spread = model.spread(m.slider)
        vector = model.vector(values, m.slider, VELOCITY_WIDTH)
        effort, jacobian = _core.inverse_dynamics_jacobian(vector, m.position, m.velocity, m.acceleration, ACTIVE)
        direct = np.column_stack([m.acceleration, np.sin(m.position), np.cos(m.position)])
        whole = np.column_stack([effort, jacobian @ spread[ACTIVE]])
        body = direct @ np.column_stack([vector, spread])[BODY_TERMS]
        rest = whole - body
        kept = rest.any(axis=0)
        body[:, kept] += m.smooth(rest[:, kept])
        at = np.flatnonzero(m.scored)[::STRIDE]
        parts.append((body[at, 1:], body[at, 0], m.effort[at]))
    w, effort, target = (np.concatenate([p[i] for p in parts]) for i in range(3))
    return w, effort, target, [len(p[1]) for p in parts]


def fit_coherent(
    model: SliderJointModel,
    motions: Sequence[SliderMotion],
    *,
    rail: tuple[float, float],
    mass: float | None = None,
    start: np.ndarray | None = None,
) -> SliderEstimate:
    """Bounded least squares, moved to the nearest body that could exist where it is none.

    Parameters
    ----------
    model : SliderJointModel
    motions : sequence of SliderMotion
    rail : tuple of float
        Ends of the rail [m].
    mass : float, optional
        Upper limit on the moving mass [kg].
    start : ndarray, shape (p,), optional
        Where a family that is not linear starts.

    Returns
    -------
    SliderEstimate

    Raises
    ------
    IdentificationError
        If a direction or a second place of the carriage is missing, or parameters cannot be told apart.
    """
    from scipy.optimize import least_squares

    require_both_directions(motions)
    require_places(motions)
    lower, upper = model.bounds()
    if start is None:
        start = np.array([LOAD_START if n.startswith("load") else 0.1 if n == "inertia" else 0.0 for n in model.names])
    w, effort, target, lengths = linearised(model, start, motions)
    _require_rank(model, w)
    scale = 1.0 / np.linalg.norm(w, axis=0)
    size = float(np.linalg.norm(target))
    if model.linear:
        goal = target - effort + w @ start
        values = bounded_least_squares(w * scale, goal, lower / scale, upper / scale) * scale
    else:

        @last_call
        def both(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            jacobian, made, _, _ = linearised(model, x * scale, motions)
            return (made - target) / size, jacobian * scale / size

        low, high = lower / scale, upper / scale
        inside = np.clip(start / scale, low + 1e-9, np.where(np.isfinite(high), high - 1e-9, high))
        found = least_squares(
            lambda x: both(x)[0], inside, jac=lambda x: both(x)[1], bounds=(low, high), xtol=1e-9, ftol=1e-12,
            gtol=1e-13, max_nfev=60,
        )  # fmt: skip
        values = found.x * scale
    notes: list[str] = []
    if np.min(model.gaps(values, rail, mass)) < 0.0:
        values = _possible(model, values, motions, rail, mass)
        notes.append("inertia and gravity are held where a body of these masses can have them")
    w, effort, target, _ = linearised(model, values, motions)
    residual = target - effort
    covariance = sandwich(w, residual, lengths)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    held = (values - lower <= 1e-3 * sd) | (upper - values <= 1e-3 * sd)
    notes += [
        f"{n} is held at its physical bound, {v:.3g}" for n, v, h in zip(model.names, values, held, strict=True) if h
    ]
    parameters = tuple(
        Parameter(n, model.unit(n), float(v), float(s), at_bound=bool(h), identifiable=bool(abs(v) > 2.0 * s and not h))
        for n, v, s, h in zip(model.names, values, sd, held, strict=True)
    )
    return SliderEstimate(
        method=model.family,
        model=model,
        values=values,
        parameters=parameters,
        covariance=covariance,
        samples=len(target),
        residual_sd=float(np.std(residual)),
        notes=tuple(notes),
    )


def _require_rank(model: SliderJointModel, w: np.ndarray) -> None:
    norms = np.linalg.norm(w, axis=0)
    idle = [n for n, size in zip(model.names, norms, strict=True) if size == 0.0]
    if idle:
        raise IdentificationError(f"{', '.join(idle)} cannot be identified: no sample shows it")
    _, singular, rows = np.linalg.svd(np.linalg.qr(w / norms, mode="r"), full_matrices=False)
    if singular[-1] < 1e-7 * singular[0]:
        tied = [n for n, c in zip(model.names, rows[-1], strict=True) if abs(c) > 0.2]
        raise IdentificationError(f"{' and '.join(tied)} cannot be told apart in these recordings")


def _possible(model, values, motions, rail, mass) -> np.ndarray:
    """The nearest values that meet the conditions of consistency, in the metric of their own residuals."""
    from scipy.optimize import minimize

    lower, upper = model.bounds()
    best = None
    for _ in range(1 if model.linear else ROUNDS):
        w, effort, target, _ = linearised(model, values, motions)
        size = float(np.linalg.norm(target))
        scale = size / np.linalg.norm(w, axis=0)
        scaled = w * (scale / size)
        gram, moment, origin = scaled.T @ scaled, scaled.T @ ((target - effort) / size), values / scale

        def cost(x, gram=gram, moment=moment, origin=origin):
            d = x - origin
            return float(0.5 * d @ gram @ d - moment @ d), gram @ d - moment

        inside = _heavy_enough(model, np.clip(values, lower, upper), rail, mass)
        unit = model.inertia(inside, np.array(rail)).max()
        found = minimize(
            cost,
            inside / scale,
            jac=True,
            method="SLSQP",
            bounds=list(zip(lower / scale, upper / scale, strict=True)),
            constraints={"type": "ineq", "fun": lambda x, s=scale, u=unit: model.room(x * s, rail, mass) / u},
            options={"maxiter": 500, "ftol": 1e-15},
        )
        nearest = found.x * scale
        if np.min(model.gaps(nearest, rail, mass)) < -1e-6:
            raise IdentificationError(f"no possible body found near these recordings: {found.message}")
        if best is None:
            best, least = nearest, _misfit(model, nearest, motions)
        else:
            step, misfit = 1.0, _misfit(model, nearest, motions)
            while misfit > least and step > 1e-3:  # the possible bodies are a convex set: halves stay in it
                step *= 0.5
                misfit = _misfit(model, best + step * (nearest - best), motions)
            if misfit >= least:
                break
            best, least = best + step * (nearest - best), misfit
        values = best
    return best


def _misfit(model, values, motions) -> float:
    _, effort, target, _ = linearised(model, values, motions)
    return float(np.sum((target - effort) ** 2))


def _heavy_enough(model, values, rail, mass) -> np.ndarray:
    """The same values with so much inertia, and some mass of the carriage, that they meet the conditions: a start."""
    values = values.copy()
    if "carriage_mass" in model.names:
        at = model.names.index("carriage_mass")
        values[at] = max(values[at], 0.05)
    at = model.names.index("inertia")
    values[at] = max(values[at], 1e-4)
    while np.min(model.gaps(values, rail, mass)) < 0.0 and values[at] < 1e6:
        values[at] *= 1.5
    return values
