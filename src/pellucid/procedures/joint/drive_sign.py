"""The sign of the drive: its effort causes the motion, and does work on the joint."""

from __future__ import annotations

import numpy as np

from ..._errors import IdentificationError
from ...fit.joint.friction_solver import solve_family
from ...fit.regression import Stack
from ...models.joint import UNITS, JointModel


def sign_error(model: JointModel, data: Stack, channel: str) -> None:
    """Refuse recordings in which the drive's effort acts against the motion it causes."""
    found = solve_family(model, data, consistent=False)
    values = dict(zip(model.names, found.values, strict=True))
    noise = np.sqrt(np.mean(found.residual**2) / np.maximum(np.sum(found.jacobian**2, axis=0), 1e-300))
    sure = {n for n, v, s in zip(model.names, found.values, noise, strict=True) if v < -10.0 * s}
    work = sum(float(np.sum(m.effort * m.velocity)) / m.fs for m in data.motions)
    if work < 0.0 and "inertia" in sure:
        unit = "J" if model.effort_unit in ("N*m", "N") else f"{model.effort_unit}*{UNITS[model.motion]['position']}"
        raise IdentificationError(
            f"the drive takes {-work:.3g} {unit} of work out of the joint and the inertia comes out negative "
            f"({values['inertia']:.3g} {model.unit('inertia')}): the sign of the drive or of the position is reversed; "
            f"set sign = -1 on channel '{channel}' or 'position' in study.toml"
        )
