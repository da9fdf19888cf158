"""How late a joint's drive is recorded against its encoder, with friction models from the simplest to a rich one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.joint import JointModel, joint_model
from ...signals.filters import anti_aliased
from ...signals.motion import Motion
from ..delay import Columns, Delay, DrivenRows, fit_delay, lag_instead, over_models
from .friction_solver import with_known_stribeck_velocity

STRIBECK_AT = 0.05
"""Share of the top speed below which the rich model's extra friction has fallen to a third."""

FEWEST_ROWS = 100
"""Rows below which a delay is not estimated: the richest model has ten parameters."""


def drive_delay(
    plain: JointModel, motions: Sequence[Motion], back_emf: float, *, quantile: float, step: float
) -> Delay | None:
    """How late the effort of `motions` is, by a `plain` model (symmetric friction) and richer ones; None where they do
    not show it. `back_emf` [N*m*s/rad or N*s/m] acts at once; the interval reaches `quantile` standard errors; `step`
    [s] is that of the recordings."""
    rows = []
    for m in motions:
        both = np.column_stack([m.effort + back_emf * m.velocity, back_emf * m.velocity])
        rows.append(DrivenRows(*anti_aliased(both, m.filtering.decimate).T, m.fs, m.kept))
    if sum(len(r.kept) for r in rows) < FEWEST_ROWS:
        return None
    fits, values = [], {}
    for model in _richer(plain, motions):
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
    found = over_models(fits, quantile, step)
    return lag_instead(found, fits[-1].after, rows, full, step) if found.clear(step) else found


def _richer(plain: JointModel, motions: Sequence[Motion]) -> tuple[JointModel, ...]:
    """The plain model; one with a level for each direction and a free zero of the angle; one whose friction also grows
    towards rest and with the load."""
    top = max(float(np.abs(m.velocity).max()) for m in motions)
    slow = max(STRIBECK_AT * top, 2.0 * max(m.filtering.dead_band for m in motions))
    gravity = "sine+cosine" if "gravity" in plain.names else "none"

    def model(family: str) -> JointModel:
        made = joint_model(
            family, motion=plain.motion, effort_unit=plain.effort_unit, gravity=gravity, known=plain.known
        )
        return replace(made, payload_scale=plain.payload_scale)

    return plain, model("directional"), with_known_stribeck_velocity(model("combined"), slow)
