"""Estimate how late a joint's drive is recorded against its encoder, with friction models of increasing richness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.joint import JointModel, joint_model
from ...signals.filters import anti_aliased
from ...signals.motion import Motion
from ..delay import Columns, Delay, DelayFit, DrivenRows, combine_models, fit_delay, prefer_better_lag
from .friction_solver import with_known_stribeck_velocity

STRIBECK_SPEED_SHARE = 0.05
"""Stribeck velocity of the richest model, as a share of the top speed. Its extra friction falls to a third there."""

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
    fits: list[DelayFit] = []
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
        found = fit_delay(rows, columns, fits[-1].delay if fits else None)
        if found is None:
            return None
        fits.append(found)
        values = dict(zip(model.names, found.values, strict=True))
    delay = combine_models(fits, quantile, step)
    return prefer_better_lag(delay, fits[-1].after, rows, full, step) if delay.clear(step) else delay


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
