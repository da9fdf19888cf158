"""Excitation of a joint's parameters by a motion: the share of each parameter's effort that no other can explain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.joint import JointModel
from ...numerics.motion import Motion
from ...numerics.regression import Stack, regression_rows


@dataclass(frozen=True)
class Excitation:
    """Range of a motion, and how well it separates the parameters of a model."""

    position: tuple[float, float]  # smallest and largest position [rad or m]
    speed: float  # largest speed [rad/s or m/s]
    acceleration: float  # largest acceleration [rad/s^2 or m/s^2]
    condition: float  # condition number of the regressor with columns of equal length
    own: dict[str, float]  # for each parameter, the share of its column's norm that no other column explains


def measure_excitation(model: JointModel, data: Stack[Motion]) -> Excitation:
    """Return the excitation of a linear `model` by the motions of `data`; their effort is not used."""
    w, _ = regression_rows(model, np.zeros(len(model.names)), data)
    norms = np.linalg.norm(w, axis=0)
    w = w[:, norms > 0.0] / norms[norms > 0.0]
    # Rows of zeros pad a regressor with fewer rows than columns.
    w = np.vstack([w, np.zeros((max(w.shape[1] - len(w), 0), w.shape[1]))])
    _, singular, axes = np.linalg.svd(np.linalg.qr(w, mode="r"))
    # The squared part of a column normal to all others is one over the diagonal of the inverse of W'W.
    apart = 1.0 / np.sum((axes / np.maximum(singular, 1e-12 * singular[0])[:, None]) ** 2, axis=0)
    seen = iter(np.sqrt(apart))
    own = {name: float(next(seen)) if n > 0.0 else 0.0 for name, n in zip(model.names, norms, strict=True)}
    position = data.reduced([m.position for m in data.motions])
    return Excitation(
        position=(float(position.min()), float(position.max())),
        speed=float(np.abs(data.reduced([m.velocity for m in data.motions])).max()),
        acceleration=float(np.abs(data.reduced([m.acceleration for m in data.motions])).max()),
        condition=float(singular[0] / max(singular[-1], 1e-300)) if norms.all() else float("inf"),
        own=own,
    )
