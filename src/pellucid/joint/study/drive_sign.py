"""Check the sign of the drive: its effort must do work on the joint."""

from __future__ import annotations

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import UNITS, JointModel
from ...numerics.regression import Stack
from ..fit.friction_solver import solve_family

MIN_ROWS_PER_PARAMETER = 10
"""A single recording's sign is checked only with more than this many rows per parameter."""


def require_sign(model: JointModel, data: Stack, channel: str) -> None:
    """Refuse recordings in which the drive's effort has the wrong sign, in all of them or in one."""
    _refuse_reversed(model, data, channel)
    names = dict.fromkeys(m.recording for m in data.motions)
    for name in names if len(names) > 1 else ():
        own = [i for i, m in enumerate(data.motions) if m.recording == name and len(data.targets[i])]
        part = Stack(tuple(data.motions[i] for i in own), tuple(data.targets[i] for i in own))
        if len(part.lengths) and sum(part.lengths) > MIN_ROWS_PER_PARAMETER * len(model.names):
            _refuse_reversed(model, part, channel, name)


def _refuse_reversed(model: JointModel, data: Stack, channel: str, alone: str = "") -> None:
    """Refuse data with negative work and a negative inertia; `alone` names a single recording."""
    try:
        found = solve_family(model, data, consistent=False)
    except IdentificationError:
        if alone:
            return  # one recording need not show every parameter
        raise
    values = dict(zip(model.names, found.values, strict=True))
    noise = np.sqrt(np.mean(found.residual**2) / np.maximum(np.sum(found.jacobian**2, axis=0), 1e-300))
    sure = {n for n, v, s in zip(model.names, found.values, noise, strict=True) if v < -10.0 * s}
    work = sum(float(np.sum(m.effort * m.velocity)) / m.fs for m in data.motions)
    if work < 0.0 and "inertia" in sure:
        whose = f"recording {alone}: " if alone else ""
        unit = "J" if model.effort_unit in ("N*m", "N") else f"{model.effort_unit}*{UNITS[model.motion]['position']}"
        raise IdentificationError(
            f"{whose}the drive takes {-work:.3g} {unit} of work out of the joint and the inertia comes out negative "
            f"({values['inertia']:.3g} {model.unit('inertia')}): the sign of the drive or of the position is reversed; "
            f"set sign = -1 on channel '{channel}' or 'position' in study.toml"
        )
