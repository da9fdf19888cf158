"""Estimate how late a joint's drive is recorded, and what of an actuator reaches its spring.

The delay against the encoder is estimated with friction models of increasing richness.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import PARALLEL_STIFFNESS, JointModel, joint_model
from ...numerics.delay import (
    Columns,
    Delay,
    DelayFit,
    DelayGrid,
    DrivenRows,
    combine_models,
    fit_delay,
    prefer_better_lag,
)
from ...numerics.filters import anti_aliased
from ...numerics.motion import Motion
from ...numerics.searches.scalar_search import minimise_on_interval
from .friction_solver import with_known_stribeck_velocity

STRIBECK_SPEED_SHARE = 0.05
"""Stribeck velocity of the richest model, as a share of the top speed. Its extra friction falls to a third there."""

MIN_EXPLAINED_EFFORT_SHARE = 0.5
"""A delay is believed only if the model with it explains at least this share of the effort's variance. Somebody who
wears the joint moves it with a phase of their own, and a shift of the effort then fits a model that explains little."""

BODY_TERMS = frozenset({"inertia", "gravity", "gravity_cosine", PARALLEL_STIFFNESS, "offset"})
"""Terms that no friction contributes to."""

MIN_ROWS = 100
"""A delay is estimated only from at least this many rows, because the richest model has ten parameters."""


def estimate_drive_delay(
    plain: JointModel, motions: Sequence[Motion], back_emf: float, *, quantile: float, step: float
) -> Delay | None:
    """Estimate the delay of the effort of `motions` with a `plain` model (symmetric friction) and richer ones.

    `back_emf` [N*m*s/rad or N*s/m] acts without delay. The interval spans `quantile` standard errors. `step` is the
    sampling period of the recordings [s]. Returns None if the motions do not determine a delay.
    """
    rows = []
    for m in motions:
        both = np.column_stack([m.effort + back_emf * m.velocity, back_emf * m.velocity])
        driven, own = anti_aliased(both, m.filtering.decimate).T
        rows.append(DrivenRows(driven, own, m.fs, m.kept))
    if sum(len(r.kept) for r in rows) < MIN_ROWS:
        return None
    grid, fits = DelayGrid.of(rows), list[DelayFit]()
    values: dict[str, float] = {}
    for model in _models_by_richness(plain, motions):
        at = np.array([values.get(name, 0.0) for name in model.names])
        columns, full = [], []
        for motion, row in zip(motions, rows, strict=True):
            effort, jacobian = model.jacobian(at, motion)
            whole = np.column_stack([effort - jacobian @ at, jacobian])
            whole = anti_aliased(whole, motion.filtering.decimate)
            full.append(whole)
            columns.append(Columns.of(whole[:, 0], whole[:, 1:], row))
        found = fit_delay(rows, grid, columns, fits[-1].delay if fits else None)
        if found is None:
            return None
        fits.append(found)
        values = dict(zip(model.names, found.values, strict=True))
    delay = combine_models(fits, quantile, step)
    if not delay.clear(step):
        return delay
    doubt = _doubt(plain, fits, motions, rows, columns, full, model.names)
    return replace(delay, doubt=doubt) if doubt else prefer_better_lag(delay, fits[-1].after, rows, full, step)


def _doubt(
    plain: JointModel,
    fits: Sequence[DelayFit],
    motions: Sequence[Motion],
    rows: Sequence[DrivenRows],
    columns: Sequence[Columns],
    full: Sequence[np.ndarray],
    names: Sequence[str],
) -> str:
    """Return why a delay is not to be believed, in words; empty if nothing speaks against it.

    `fits` are those of all models. `columns` and `full` are those of the richest one, with the parameters `names`.
    """
    simple = dict(zip(plain.names, fits[0].values, strict=True))
    if simple.get("inertia", 1.0) <= 0.0:
        return "with it the inertia is negative"
    if simple.get("gravity", 1.0) <= 0.0:
        return "with it the joint's weight pushes upwards"
    effort = np.concatenate([r.at(0.0)[0] for r in rows])
    explained = 1.0 - fits[-1].after / max(float(np.var(effort)), np.finfo(float).tiny)
    if explained < MIN_EXPLAINED_EFFORT_SHARE:
        return f"the model with it explains {100.0 * max(explained, 0.0):.0f} % of the effort"
    for what, left in _alternatives(motions, rows, columns, full, fits[-1].values, names):
        if left <= fits[-1].after:
            return f"{what} explains the effort as well"
    return ""


def _alternatives(
    motions: Sequence[Motion],
    rows: Sequence[DrivenRows],
    columns: Sequence[Columns],
    full: Sequence[np.ndarray],
    values: np.ndarray,
    names: Sequence[str],
) -> Iterator[tuple[str, float]]:
    """Yield other explanations of a delay, in words, with the mean square residual that each leaves without a delay.

    Friction that builds up over a distance, or is lost in a gap, changes late while inertia and weight do not: each of
    its terms has a slope in time of its own. A spring between encoder and body turns by effort over stiffness: that
    adds the second derivative of the effort, and weight times the effort.
    """
    w = np.concatenate([c.regressor for c in columns])
    y = np.concatenate([r.at(0.0)[0] for r in rows]) - np.concatenate([c.intercept for c in columns])
    rubbing = [i for i, name in enumerate(names) if name not in BODY_TERMS]
    yield (
        "friction that builds up late",
        _mean_square_left(np.hstack([w, np.concatenate([c.regressor_slope for c in columns])[:, rubbing]]), y),
    )
    elastic = []
    for motion, row, whole in zip(motions, rows, full, strict=True):
        modelled = whole[:, 0] + whole[:, 1:] @ values
        bent = np.gradient(np.gradient(modelled, 1.0 / row.fs), 1.0 / row.fs)
        elastic.append(np.column_stack([bent, np.cos(motion.position) * modelled])[row.kept])
    yield "a spring between encoder and body", _mean_square_left(np.hstack([w, np.concatenate(elastic)]), y)


def _mean_square_left(regressor: np.ndarray, target: np.ndarray) -> float:
    """Return the mean square that least squares leaves of a target, (m,), by a regressor, (m, p)."""
    size = np.linalg.norm(regressor, axis=0)
    scaled = regressor[:, size > 0.0] / size[size > 0.0]
    left = target - scaled @ np.linalg.lstsq(scaled, target, rcond=1e-9)[0]
    return float(np.mean(left**2))


def _models_by_richness(plain: JointModel, motions: Sequence[Motion]) -> tuple[JointModel, ...]:
    """Return three models, the simplest first.

    The second has a friction level for each direction and a free zero of the angle. The friction of the third also
    grows towards rest and with the load.
    """
    top = max(float(np.abs(m.velocity).max()) for m in motions)
    slow = max(STRIBECK_SPEED_SHARE * top, 2.0 * max(m.filtering.dead_band for m in motions))
    gravity = "sine+cosine" if "gravity" in plain.names else "none"

    def model(family: str) -> JointModel:
        made = joint_model(
            family, motion=plain.motion, effort_unit=plain.effort_unit, gravity=gravity, known=plain.known
        )
        return replace(made, payload_scale=plain.payload_scale)

    return plain, model("directional"), with_known_stribeck_velocity(model("combined"), slow)


def actuator_residual(
    recordings: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]], fs: float, *, cutoff: float = 20.0
) -> dict[str, float]:
    """Estimate the inertia and friction that reach the spring, the loop's natural frequency, and its leak rate.

    With e = command - torque, K the spring and the motor's angle q_m = q + torque/K, a motor under proportional,
    integral and rate feedback of the spring's torque has

        e + leak integral(e) = J a_m + b v_m + F sign(v_m) + c dtorque/dt + constant.

    With the orthosis held, torque follows the command with w^2 = K/J and 2 zeta w = b/J + c K/J. Every signal goes
    through the same zero-phase low-pass. The leak is found by a line search, the other parameters by least squares.

    Each of `recordings` has command [N m], torque [N m], joint position [rad] and motor angle [rad], each (n,); `fs`
    and `cutoff` are in [Hz]. The results are in [kg m^2], [N m s/rad], [N m], [1/s], [rad/s], 1, [N m/rad] and 1.
    """
    from scipy.signal import butter, sosfiltfilt

    sos = butter(4, cutoff, fs=fs, output="sos")
    kept, spring = [], []
    for command, torque, position, motor in recordings:
        e, q = sosfiltfilt(sos, np.asarray(command) - torque), sosfiltfilt(sos, motor)
        rate = np.gradient(sosfiltfilt(sos, torque), 1 / fs)
        spring.append((np.asarray(motor) - position, np.asarray(torque)))
        v = np.gradient(q, 1 / fs)
        edge = round(fs / 2)
        window = slice(edge, len(q) - edge)
        kept.append((e[window], np.cumsum(e)[window] / fs, v[window], np.gradient(v, 1 / fs)[window], rate[window]))
    moving = [np.abs(v) > 0.05 * np.abs(v).max() for _, _, v, _, _ in kept]
    if sum(m.sum() for m in moving) < 2 * fs:
        raise IdentificationError(
            f"actuator_residual: the joint moves in {sum(m.sum() for m in moving) / fs:.1f} s, expected at least 2 s."
        )
    columns, now, summed = [], [], []
    for i, ((e, total, v, a, rate), m) in enumerate(zip(kept, moving, strict=True)):
        constants = np.zeros((m.sum(), len(kept)))
        constants[:, i] = 1
        columns.append(np.column_stack([a[m], v[m], np.sign(v[m]), rate[m], constants]))
        now.append(e[m])
        summed.append(total[m])
    x, e, total = np.vstack(columns), np.concatenate(now), np.concatenate(summed)

    def rest(leak: float) -> tuple[float, np.ndarray]:
        y = e + leak * total
        beta = np.linalg.lstsq(x, y, rcond=None)[0]
        return float(np.sum((y - x @ beta) ** 2) / np.sum((y - y.mean()) ** 2)), beta

    leak = minimise_on_interval(lambda c: rest(c)[0], 0.0, 8.0)
    share, beta = rest(leak)
    inertia, viscous, coulomb, feedback = (float(b) for b in np.maximum(beta[:4], 0.0))
    deflection, torque = (np.concatenate(parts) for parts in zip(*spring, strict=True))
    stiffness = float(deflection @ torque / (deflection @ deflection))
    frequency = np.sqrt(stiffness / max(inertia, 1e-9))
    return {
        "actuator_inertia": inertia,
        "actuator_viscous": viscous,
        "actuator_coulomb": coulomb,
        "actuator_leak": leak,
        "actuator_frequency": float(frequency),
        "actuator_damping": float((viscous + feedback * stiffness) / (2 * max(inertia, 1e-9) * frequency)),
        "spring_stiffness": stiffness,
        "actuator_fit": 1 - share,
    }
